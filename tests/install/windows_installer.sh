#!/usr/bin/env bash
# The Windows installer, tried under Wine: tests/install/windows_installer.sh SETUP.exe [FOLDER FOR LOGS AND PICTURES]
#
# In a Windows of its own (a fresh Wine prefix, in the root of tests/windows/root.sh): installs silently for one person,
# solves a sample with the installed command, opens another as Explorer's "Open with" does and takes the window's picture, tries
# to install over a running Kochab, and removes it, first keeping settings, then with all. A line a case; exit 1 when one failed.
set -u
setup=$(realpath "${1:?the installer}")
logs=$(realpath -m "${2:-/tmp/kochab-installer}")
here=$(cd "$(dirname "$0")" && pwd)
windows=$here/../windows/root.sh
root=${WINDOWS_ROOT:-/var/tmp/kochab-windows}
prefix=$root/win/installed
drive=$prefix/drive_c
programs=$drive/users/root/AppData/Local/Programs/Kochab
own=$drive/users/root/AppData/Local/kochab
link="$drive/users/root/AppData/Roaming/Microsoft/Windows/Start Menu/Programs/Kochab.lnk"
failed=0
mkdir -p "$logs"

says() { # CASE WHETHER [LOG]; whether is a code, kept before anything else is asked
  if [ "$2" = 0 ]; then echo "ok      $1"; else failed=1; echo "FAILED  $1"; [ -z "${3:-}" ] || tail -5 "$3" | cut -c1-300 | sed 's/^/          /'; fi
}

there() { # COMMAND: in the root, in that Windows
  "$windows" shell "export WINEPREFIX=/win/installed DISPLAY=:97; $1"
}

left() { # what is on the drive and in this person's registry; programs' own temporary files are not asked about
  (cd "$drive" && find . -path ./users/root/AppData/Local/Temp -prune -o -path ./users/root/Temp -prune -o -print | sort)
  there 'wine reg export HKCU /win/installed/hkcu.reg /y >/dev/null; wineserver -w'
  iconv -f utf-16 "$prefix/hkcu.reg" 2>/dev/null | tr -d '\r' | awk '/^\[/ {key = $0} tolower($0) ~ /kochab/ {print key, $0}'
}

remove() { # OPTIONS: the uninstaller works in a copy of itself, which is waited for
  there "wine 'C:\\users\\root\\AppData\\Local\\Programs\\Kochab\\uninstall.exe' /S $1; wineserver -w"
}

rm -rf "$prefix"
cp "$setup" "$root/win/setup.exe"
"$windows" checkout
there 'wineboot -i >/dev/null 2>&1; wineserver -w'
left >"$logs/before.txt"

there 'wine /win/setup.exe /S; echo "exit $?"; wineserver -w' >"$logs/install.log" 2>&1
grep -q 'exit 0' "$logs/install.log" && [ -e "$programs/kochab.exe" ] && [ -e "$programs/kochab-window.exe" ] && [ -e "$link" ]
code=$?
says "installs silently, for one person, with its place in the start menu ($(du -sm "$programs" 2>/dev/null | cut -f1) MB)" $code "$logs/install.log"

left >"$logs/installed.txt"
for ending in fits fit fts xisf tif tiff jpg jpeg; do
  grep -Fq "Classes\\.$ending\\OpenWithProgids] \"Kochab.Image\"" "$logs/installed.txt"
  says "\"Open with\" for .$ending" $?
done

cp "$here/../../resources/samples/orion.png" "$drive/users/root/Orion über dem Haus.png"
there "wine 'C:\\users\\root\\AppData\\Local\\Programs\\Kochab\\kochab.exe' solve 'C:\\users\\root\\Orion über dem Haus.png' --json; echo \"exit \$?\"" >"$logs/solve.log" 2>&1
grep -q '"solved": true' "$logs/solve.log" && grep -q 'exit 0' "$logs/solve.log"
code=$?
says "solves a sample: $(grep -o '"ra_deg": [0-9.]*, "dec_deg": [-0-9.]*' "$logs/solve.log" | head -1)" $code "$logs/solve.log"
cp "$here/../../resources/samples/pleiades.fits" "$drive/users/root/M 45.fits"
there "wine 'C:\\users\\root\\AppData\\Local\\Programs\\Kochab\\kochab.exe' solve 'C:\\users\\root\\M 45.fits' 'C:\\users\\root\\Orion über dem Haus.png' --workers 2 --json; echo \"exit \$?\"" >"$logs/workers.log" 2>&1
[ "$(grep -c '"solved": true' "$logs/workers.log")" = 2 ]
says "solves two in two processes" $? "$logs/workers.log"

# What the samples do not load: each method and detector, photutils' among them, and the bodies of the Solar System.
there "kochab() { wine 'C:\\users\\root\\AppData\\Local\\Programs\\Kochab\\kochab.exe' \"\$@\"; echo \"exit \$?\"; }
  cd /win/installed; kochab solve --methods; kochab find M31 67P; kochab chart 'M 31' m31.pdf
  kochab solve 'C:\\users\\root\\M 45.fits' --detector daostarfinder" >"$logs/methods.log" 2>&1
[ "$(grep -c 'exit 0' "$logs/methods.log")" = 4 ] && ! grep -q "cannot be loaded" "$logs/methods.log"
says "loads every method and detector, finds a comet, prints a chart, solves with photutils' stars" $? "$logs/methods.log"

# As Explorer does: the command of the registry, with the file in the place of %1.
there 'Xvfb :97 -screen 0 1600x1000x24 >/dev/null 2>&1 & screen=$!; sleep 2
  command=$(wine reg query "HKCU\\Software\\Classes\\Kochab.Image\\shell\\open\\command" /ve | tr -d "\r" | sed -n "s/.*REG_SZ *//p")
  program=$(sed "s/^\"\([^\"]*\)\".*/\1/" <<<"$command")
  (wine "$program" "C:\\users\\root\\M 45.fits" </dev/null >/dev/null 2>&1) &
  for i in $(seq 60); do sleep 3; xdotool search --name "M 45" >/dev/null 2>&1 && break; done
  sleep '"${SHOT_AFTER_S:-40}"'
  import -window root /win/installed/window.png
  xdotool search --name "M 45" getwindowname
  wine /win/setup.exe /S; echo "exit $?"
  wineserver -k; kill $screen' >"$logs/window.log" 2>&1
mv "$prefix/window.png" "$logs/" 2>/dev/null
grep -q "M 45" "$logs/window.log"
says "opens a frame in its window: $logs/window.png" $? "$logs/window.log"
grep -q 'exit 3' "$logs/window.log"
says "is not installed over a running Kochab" $? "$logs/window.log"

remove "" >"$logs/remove.log" 2>&1
left >"$logs/removed.txt"
[ ! -e "$programs" ] && [ ! -e "$link" ] && [ ! -e "$own/Cache" ] && ! grep '^\[' "$logs/removed.txt"
code=$?
says "is removed silently; what stays are settings and the journal: $(cd "$own" 2>/dev/null && find . -type f | wc -l) files" $code "$logs/removed.txt"

there 'wine /win/setup.exe /S; wineserver -w' >>"$logs/install.log" 2>&1
remove /FORGET >>"$logs/remove.log" 2>&1
rm -f "$drive/users/root/M 45.fits" "$drive/users/root/Orion über dem Haus.png"
left >"$logs/forgotten.txt"
diff "$logs/before.txt" "$logs/forgotten.txt" >"$logs/difference.txt"
says "is removed with everything: no file, no key of the registry" $? "$logs/difference.txt"
exit $failed
