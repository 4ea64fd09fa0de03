#!/usr/bin/env bash
# Are the system libraries there that Qt's wheel leaves to the system?
#
#   .ci/qt_libraries.sh VENV             name the packages that are missing, exit 1 if any is
#   .ci/qt_libraries.sh VENV --install   install them with apt-get (needs root)
#
# The dynamic linker is asked, not the package manager, so any Linux is served; only the package
# names are those of Debian and Ubuntu.
set -u
venv=${1:?the virtual environment}
action=${2:-name}
[ "$(uname -s)" = Linux ] || exit 0

declare -A package=(
  [libEGL.so.1]=libegl1 [libGL.so.1]=libgl1 [libGLX.so.0]=libgl1 [libOpenGL.so.0]=libopengl0
  [libGLdispatch.so.0]=libgl1
  [libglib-2.0.so.0]=libglib2.0-0 [libgthread-2.0.so.0]=libglib2.0-0
  [libdbus-1.so.3]=libdbus-1-3 [libfontconfig.so.1]=libfontconfig1
  [libfreetype.so.6]=libfreetype6 [libz.so.1]=zlib1g [libstdc++.so.6]=libstdc++6
  [libX11.so.6]=libx11-6 [libX11-xcb.so.1]=libx11-xcb1
  [libxkbcommon.so.0]=libxkbcommon0 [libxkbcommon-x11.so.0]=libxkbcommon-x11-0
  [libxcb.so.1]=libxcb1 [libxcb-cursor.so.0]=libxcb-cursor0 [libxcb-glx.so.0]=libxcb-glx0
  [libxcb-icccm.so.4]=libxcb-icccm4 [libxcb-image.so.0]=libxcb-image0
  [libxcb-keysyms.so.1]=libxcb-keysyms1 [libxcb-randr.so.0]=libxcb-randr0
  [libxcb-render.so.0]=libxcb-render0 [libxcb-render-util.so.0]=libxcb-render-util0
  [libxcb-shape.so.0]=libxcb-shape0 [libxcb-shm.so.0]=libxcb-shm0
  [libxcb-sync.so.1]=libxcb-sync1 [libxcb-util.so.1]=libxcb-util1
  [libxcb-xfixes.so.0]=libxcb-xfixes0 [libxcb-xkb.so.1]=libxcb-xkb1
)

qt=$("$venv/bin/python" -c 'import importlib.util as u; print(u.find_spec("PySide6").submodule_search_locations[0])')/Qt
missing=$(
  for file in "$qt"/lib/libQt6{Core,Gui,Widgets,DBus,OpenGL,OpenGLWidgets,Svg,XcbQpa}.so.6 \
      "$qt"/plugins/platforms/libq{xcb,offscreen}.so "$qt"/plugins/xcbglintegrations/*.so; do
    [ -e "$file" ] && ldd "$file"
  done | awk '/not found/ {print $1}' | sort -u
)
[ -n "$missing" ] || exit 0

packages=$(for library in $missing; do echo "${package[$library]:-$library}"; done | sort -u | xargs)
if [ "$action" = --install ] || [ "${CI:-}" = true ]; then
  if [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null; then
    echo "Installing Qt's system libraries: $packages"
    export DEBIAN_FRONTEND=noninteractive
    apt-get update -qq && apt-get install -y -qq --no-install-recommends $packages >/dev/null && exit 0
    echo "apt-get could not install them." >&2
  fi
fi
echo "Qt needs system libraries that are not here; install them with: sudo apt-get install $packages" >&2
exit 1
