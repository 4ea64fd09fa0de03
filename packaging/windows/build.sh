#!/usr/bin/env bash
# The Windows installer, made on Debian: packaging/windows/build.sh [FOLDER]   (dist/windows)
#
# PyInstaller freezes this checkout under Wine, with the real Windows Python of tests/windows/root.sh; Debian's NSIS packs
# it. Needs that root (root.sh makes it). QUICK=1 packs larger and faster. README.md beside this says what is untried.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
checkout=$(cd "$here/../.." && pwd)
to=$(realpath -m "${1:-$checkout/dist/windows}")
windows=$checkout/tests/windows/root.sh
root=${WINDOWS_ROOT:-/var/tmp/kochab-windows}
version=$(sed -n 's/^__version__ = "\(.*\)"/\1/p' "$checkout/app/kochab/core/__init__.py")
name=kochab-$version-windows-x64.exe

"$windows" checkout
rm -rf "$root/win/build" "$root/win/dist"
"$windows" python -m PyInstaller --noconfirm --log-level ${LOG:-WARN} --workpath /win/build --distpath /win/dist packaging/windows/kochab.spec
[ -e "$root/win/dist/kochab/kochab.exe" ] || { echo "PyInstaller made no program" >&2; exit 1; }
"$windows" shell "makensis -V2 ${QUICK:+-DQUICK} -DVERSION=$version -DFOLDER=/win/dist/kochab -DICON=/win/build/kochab/kochab.ico \
  -DOUT=/win/$name packaging/windows/kochab.nsi"
mkdir -p "$to"
mv "$root/win/$name" "$to/"
(cd "$to" && sha256sum "$name" | tee "$name.sha256")
du -sh "$root/win/dist/kochab" | sed "s|$root/win/||"
