#!/usr/bin/env bash
# The .deb on fresh machines: tests/install/debian_package.sh KOCHAB.deb FOLDER [SUITE...]
#
# Makes a root of each SUITE (bookworm and trixie) in FOLDER with nothing but Debian's smallest system, installs the
# package with apt, solves samples, opens the window on a virtual screen, asks man and three shells, and removes it.
# A package for another kind of machine is run by qemu-user (ONLY=solve leaves the window out), registered with the
# kernel by its binfmt_misc. Needs root, debootstrap, Xvfb, xdotool and imagemagick. A line a case; exit 1 when one failed.
set -u
deb=$(realpath "${1:?the package}")
folder=$(realpath -m "${2:?a folder for the roots}"); shift 2
[ $# -gt 0 ] || set -- bookworm trixie
checkout=$(cd "$(dirname "$0")/../.." && pwd)
arch=$(dpkg-deb -f "$deb" Architecture)
mirror=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1)
[ -n "$mirror" ] || mirror=$(awk '$1 == "deb" {print $2; exit}' /etc/apt/sources.list)
mkdir -p "$folder"
failed=0
# An emulated machine is thirty times slower: what it does is tried, not its speed.
patience=30 appears=80 drawn=12
[ "$arch" = "$(dpkg --print-architecture)" ] || patience=900 appears=900 drawn=180
display=:$((100 + $$ % 400))  # two of these may run side by side
Xvfb "$display" -screen 0 1280x800x24 >/dev/null 2>&1 &
screen=$!
trap 'kill $screen' EXIT

says() { # CASE WHETHER [LOG]
  if [ "$2" = 0 ]; then echo "ok      $1"; else failed=1; echo "FAILED  $1"; [ -z "${3:-}" ] || tail -5 "$3" | cut -c1-300 | sed 's/^/          /'; fi
}

register() { # qemu-user for $arch, where this machine is of another kind
  [ "$arch" = "$(dpkg --print-architecture)" ] && return
  [ -e /proc/sys/fs/binfmt_misc/register ] || mount -t binfmt_misc none /proc/sys/fs/binfmt_misc
  # The magic of an ELF file for AArch64; F keeps the interpreter open, so that no root needs a copy of it.
  [ -e /proc/sys/fs/binfmt_misc/kochab-aarch64 ] || printf '%s' ':kochab-aarch64:M::\x7fELF\x02\x01\x01\x00\x00\x00\x00\x00\x00\x00\x00\x00\x02\x00\xb7\x00:\xff\xff\xff\xff\xff\xff\xff\x00\xff\xff\xff\xff\xff\xff\xff\xff\xfe\xff\xff\xff:/usr/bin/qemu-aarch64-static:F' \
    >/proc/sys/fs/binfmt_misc/register
}

base() { # SUITE: Debian's smallest system
  local root=$folder/$1-$arch-base
  [ -e "$root/ready" ] && return
  # What a run that was killed has left, with its /proc mounted.
  umount -q "$root/proc" "$root/sys" 2>/dev/null
  rm -rf --one-file-system "$root"
  debootstrap --variant=minbase --arch="$arch" --include=ca-certificates "$1" "$root" "$mirror" >"$folder/$1-$arch-debootstrap.log" 2>&1
  useradd --root "$root" --create-home ann
  touch "$root/ready"
}

inside() { # USER COMMAND: in $root; mounts end with the command, for they are in a namespace of its own
  unshare --mount --propagation private bash -c '
    for place in proc dev tmp/.X11-unix; do mkdir -p "$1/$place"; mount --rbind "/$place" "$1/$place"; done
    exec chroot --userspec="$2" "$1" env -i HOME="$([ "$2" = root ] && echo /root || echo /home/ann)" LC_ALL=C.UTF-8 \
      PATH=/usr/sbin:/usr/bin:/sbin:/bin DISPLAY="$4" DEBIAN_FRONTEND=noninteractive sh -c "cd; $3"' bash "$root" "$1" "$2" "$display" 2>&1
}

listed() { # every file but those that apt, the loader, man and other packages' caches keep for themselves
  (cd "$root" && find . -path ./proc -prune -o -path ./dev -prune -o -path ./tmp -prune -o -path ./home -prune -o -path ./root -prune \
    -o -path ./var/cache -prune -o -path ./var/log -prune -o -path ./var/lib/apt -prune -o -path './var/lib/dpkg/*' -prune -o -print | sort)
}

register
for suite in "$@"; do
  base "$suite"
  root=$folder/$suite-$arch
  rm -rf "$root"
  cp -a "$folder/$suite-$arch-base" "$root"
  cp "$deb" "$root/kochab.deb"
  # What the package depends on stays when it goes, so it is there before the first list.
  log=$folder/$suite-$arch-install.log
  inside root "apt-get update -qq && apt-get install -y -qq --no-install-recommends /kochab.deb && dpkg --remove kochab &&
    apt-get install -y -qq --no-install-recommends man-db bash-completion zsh fish udev desktop-file-utils shared-mime-info" >"$log"
  listed >"$folder/$suite-$arch-before.txt"
  start=$(date +%s)
  inside root "apt-get install -y -qq --no-install-recommends /kochab.deb" >>"$log"
  says "$suite $arch: installs ($(du -sm "$root/usr/lib/kochab" | cut -f1) MB, $(($(date +%s) - start)) s, package $(($(stat -c %s "$deb") / 1000000)) MB)" $? "$log"
  absent=$(inside root 'find /usr/lib/kochab -name "*.so*" -type f -not -path "*.libs/*" -exec ldd {} + 2>/dev/null' | grep "not found" | grep -v "libpyside6\|libshiboken6" | sort -u)
  [ -z "$absent" ]
  says "$suite $arch: every library is there $absent" $?

  cp "$checkout"/resources/samples/{orion.png,pleiades.fits,big-dipper.jpg} "$root/home/ann/"
  log=$folder/$suite-$arch-solve.log
  inside ann "kochab solve orion.png pleiades.fits big-dipper.jpg --json --workers 2 --timeout $patience; echo exit \$?" >"$log"
  [ "$(grep -c '"solved": true' "$log")" = 3 ] && grep -q 'exit 0' "$log"
  says "$suite $arch: solves three samples" $? "$log"
  # What the three do not load: each method and detector, photutils' among them, and the bodies of the Solar System.
  log=$folder/$suite-$arch-methods.log
  inside ann "kochab solve --methods && kochab find M31 67P && kochab chart 'M 31' m31.pdf; echo exit \$?" >"$log"
  grep -q 'exit 0' "$log" && ! grep -q "cannot be loaded" "$log" && grep -q "detector daostarfinder\|needs photutils" "$log"
  says "$suite $arch: every method and detector loads, finds a comet, prints a chart" $? "$log"
  kib=$(inside ann "cat >most.py && /usr/lib/kochab/bin/python3 most.py kochab solve orion.png" <<'PY' | tail -1
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
PY
)
  [ "${kib:-x}" -lt 400000 ] 2>/dev/null
  says "$suite $arch: a solve takes $((${kib:-0} / 1000)) MB at most (400)" $?

  inside ann "man kochab-mount | col -b 2>/dev/null || man kochab-mount" | grep -q -- "--equatorial"
  says "$suite $arch: man kochab-mount" $?
  inside ann "bash -c '. /usr/share/bash-completion/completions/kochab; COMP_WORDS=(kochab mount s); COMP_CWORD=2; _kochab; echo \${COMPREPLY[*]}'" | grep -q sync
  says "$suite $arch: bash completes" $?
  inside ann "fish -c 'complete -C\"kochab mount s\"'" | grep -q sync
  says "$suite $arch: fish completes" $?
  inside ann "zsh -fc 'autoload -U compinit; compinit -u; print \$_comps[kochab]; autoload +X _kochab && print loads'" | tr '\n' ' ' | grep -q "_kochab loads"
  says "$suite $arch: zsh finds its completion" $?
  inside root "desktop-file-validate /usr/share/applications/kochab.desktop && grep -q 'image/x-xisf=kochab' /usr/share/applications/mimeinfo.cache &&
    grep -q 'xisf' /usr/share/mime/globs" >"$folder/$suite-$arch-desktop.log"
  says "$suite $arch: desktop file, \"Open with\" for FITS and XISF" $? "$folder/$suite-$arch-desktop.log"
  if inside root "udevadm verify --help" >/dev/null; then
    inside root "udevadm verify /usr/lib/udev/rules.d/60-kochab.rules" >"$folder/$suite-$arch-udev.log"
    says "$suite $arch: udev takes the rules" $? "$folder/$suite-$arch-udev.log"
  fi

  if [ "${ONLY:-}" != solve ]; then
    (inside ann "timeout $((appears + drawn)) kochab orion.png" >"$folder/$suite-$arch-window.log") &
    shown=1
    for second in $(seq $appears); do
      sleep 1
      DISPLAY=$display xdotool search --onlyvisible --name "orion" >/dev/null 2>&1 && { shown=0; break; }
    done
    sleep $drawn
    DISPLAY=$display import -window root "$folder/$suite-$arch-window.png"
    DISPLAY=$display xdotool search --onlyvisible --name "orion" windowkill 2>/dev/null
    wait $!
    says "$suite $arch: opens a frame in its window after $second s" $shown "$folder/$suite-$arch-window.log"
  fi

  log=$folder/$suite-$arch-remove.log
  inside root "apt-get purge -y -qq kochab" >"$log"
  listed >"$folder/$suite-$arch-after.txt"
  diff "$folder/$suite-$arch-before.txt" "$folder/$suite-$arch-after.txt" >"$folder/$suite-$arch-difference.txt" && [ ! -e "$root/usr/lib/kochab" ]
  says "$suite $arch: is removed without a trace" $? "$folder/$suite-$arch-difference.txt"
done
exit $failed
