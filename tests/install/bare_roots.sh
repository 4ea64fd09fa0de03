#!/usr/bin/env bash
# The README's two commands on bare Debian machines: tests/install/bare_roots.sh FOLDER [SUITE...]
#
# Makes a root of each SUITE (bookworm and trixie) in FOLDER with Python and make alone, puts the last commit there, and
# tries `make run` and `make test` as root with apt, as root without a network for apt, and as a user who may not
# install. Needs root, debootstrap and Xvfb; about ten minutes and 3 GB a suite. A line a case; exit 1 when one failed.
set -u
folder=$(realpath -m "${1:?a folder for the roots}"); shift
[ $# -gt 0 ] || set -- bookworm trixie
checkout=$(cd "$(dirname "$0")/../.." && pwd)
mirror=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1)
[ -n "$mirror" ] || mirror=$(awk '$1 == "deb" {print $2; exit}' /etc/apt/sources.list)
mkdir -p "$folder"
failed=0
display=:87
Xvfb "$display" -screen 0 1280x800x24 >/dev/null 2>&1 &
screen=$!
trap 'kill $screen; for place in "$folder"/*/; do release "${place%/}"; done' EXIT

release() { # whatever is mounted in the root $1
  for inside in tmp/.X11-unix dev/pts dev proc; do umount -q "$1/$inside" 2>/dev/null; done
}

base() { # SUITE: Debian, Python and make, and this machine's way to its package indexes
  local root=$folder/$1-base
  [ -e "$root/ready" ] && return
  debootstrap --variant=minbase --include=python3,make,ca-certificates "$1" "$root" "$mirror" >"$folder/$1-debootstrap.log" 2>&1
  cp -rL /etc/ssl/certs/ca-certificates.crt "$root/etc/ssl/certs/"
  useradd --root "$root" --create-home ann
  touch "$root/ready"
}

fresh() { # SUITE CASE: a copy of the base with the checkout; its path
  local root=$folder/$1-$2
  release "$root"
  rm -rf --one-file-system "$root"  # never into a /dev that is still busy
  cp -a "$folder/$1-base" "$root"
  mkdir -p "$root/home/ann/kochab" "$root/tmp/.X11-unix"
  git -C "$checkout" archive HEAD | tar x -C "$root/home/ann/kochab"
  chroot "$root" chown -R ann /home/ann/kochab
  mount --bind /proc "$root/proc"
  mount --bind /dev "$root/dev"
  mount --bind /dev/pts "$root/dev/pts"
  mount --bind /tmp/.X11-unix "$root/tmp/.X11-unix"
  echo "$root"
}

inside() { # ROOT USER COMMAND: as a person would type it, in the checkout
  chroot --userspec="$2" "$1" env -i HOME="$([ "$2" = root ] && echo /root || echo /home/ann)" PATH=/usr/sbin:/usr/bin:/sbin:/bin \
    DISPLAY=$display LC_ALL=C.UTF-8 PIP_CERT=/etc/ssl/certs/ca-certificates.crt PIP_NO_CACHE_DIR=1 \
    sh -c "cd /home/ann/kochab && $3" 2>&1
}

says() { # CASE WHETHER: one line, and what the case printed where it failed
  if [ "$2" = 0 ]; then echo "ok      $1"; else failed=1; echo "FAILED  $1"; tail -5 "$log" | sed 's/^/          /'; fi
}

opens() { # CASE ROOT USER: `make run` opens a window that stays
  log=$folder/${1// /-}.log
  inside "$2" "$3" "timeout -k 5 1500 make run & make=\$!
    for i in \$(seq 1480); do sleep 1; [ -e /tmp/shown ] && break; kill -0 \$make || break; done; kill \$make; [ -e /tmp/shown ]" >"$log" &
  local running=$! shown=1 begun=$SECONDS second
  while [ $((second = SECONDS - begun)) -lt 1490 ]; do
    kill -0 $running 2>/dev/null || break
    if DISPLAY=$display xdotool search --onlyvisible --name Kochab >/dev/null 2>&1; then
      sleep 3
      DISPLAY=$display import -window root "$folder/${1// /-}.png" 2>/dev/null
      touch "$2/tmp/shown"
      shown=0
      break
    fi
    sleep 1
  done
  wait $running
  pkill -f "$2" 2>/dev/null
  inside "$2" root "pkill -f 'python -m app'" >/dev/null 2>&1
  rm -f "$2/tmp/shown"
  says "$1: make run opens the window after $second s" $shown
}

tests() { # CASE ROOT USER; not with ONLY=run
  [ "${ONLY:-}" != run ] || return
  log=$folder/${1// /-}-test.log
  inside "$2" "$3" "make test TESTS=tests/core" >"$log"
  local code=$?
  says "$1: make test: $(tail -1 "$log" | tr -d =)" $code
}

refuses() { # CASE ROOT USER: one sentence that names one command; the command is left in $typed
  log=$folder/${1// /-}.log
  inside "$2" "$3" "make run" >"$log"
  local code=$?
  typed=$(sed -n 's/.*install them with: sudo //p' "$log")
  [ "$code" != 0 ] && [ -n "$typed" ] && [ "$(grep -vc '^make: ' "$log")" -le 2 ]
  says "$1: make run names one command: ${typed:0:60}..." $?
}

for suite in "$@"; do
  base "$suite"
  root=$(fresh "$suite" user)
  mkdir -p "$root/etc/apt/apt.conf.d"
  echo 'Acquire::http::Proxy "http://127.0.0.1:9"; Acquire::https::Proxy "http://127.0.0.1:9"; Acquire::Retries "0";' >"$root/etc/apt/apt.conf.d/99away"
  refuses "$suite, root without a network for apt" "$root" root
  rm "$root/etc/apt/apt.conf.d/99away"
  refuses "$suite, user who may not install" "$root" ann
  inside "$root" root "apt-get update -qq && env DEBIAN_FRONTEND=noninteractive ${typed/install/install -y -qq --no-install-recommends}" >"$folder/$suite-typed.log"
  opens "$suite, user after that command" "$root" ann
  tests "$suite, user after that command" "$root" ann
  release "$root"
  root=$(fresh "$suite" root)
  opens "$suite, root" "$root" root
  tests "$suite, root" "$root" root
  release "$root"
done
exit $failed
