#!/usr/bin/env bash
# What the system must have before Kochab runs or is tested.
#
#   .ci/system.sh run     Python's venv, and the libraries that Qt's wheel leaves to the system
#   .ci/system.sh test    these, and what the tests drive: a virtual screen, INDI, faketime, locales, a screen reader's bus
#
# Files are looked for, not packages, so that any Linux is served and names may differ from release to release; only
# the package names are those of Debian and Ubuntu. As root, or with a sudo that does not ask, what is absent is
# installed; otherwise one sentence names the one command to type. Without Qt's libraries or venv that is the end
# (exit 1); the tests that miss something else skip and say what.
set -u
purpose=${1:?run or test}
[ "$(uname -s)" = Linux ] || exit 0
PATH=$PATH:/usr/sbin:/sbin
python=${PYTHON:-python3}

# Library -> package. The first lines are what Qt links, the last what its xcb platform loads.
libraries="libEGL.so.1=libegl1 libGL.so.1=libgl1 libOpenGL.so.0=libopengl0 libglib-2.0.so.0=libglib2.0-0
  libdbus-1.so.3=libdbus-1-3 libfontconfig.so.1=libfontconfig1 libfreetype.so.6=libfreetype6 libz.so.1=zlib1g
  libstdc++.so.6=libstdc++6 libX11.so.6=libx11-6 libX11-xcb.so.1=libx11-xcb1 libxkbcommon.so.0=libxkbcommon0
  libxkbcommon-x11.so.0=libxkbcommon-x11-0 libxcb.so.1=libxcb1 libxcb-cursor.so.0=libxcb-cursor0
  libxcb-glx.so.0=libxcb-glx0 libxcb-icccm.so.4=libxcb-icccm4 libxcb-image.so.0=libxcb-image0
  libxcb-keysyms.so.1=libxcb-keysyms1 libxcb-randr.so.0=libxcb-randr0 libxcb-render.so.0=libxcb-render0
  libxcb-render-util.so.0=libxcb-render-util0 libxcb-shape.so.0=libxcb-shape0 libxcb-shm.so.0=libxcb-shm0
  libxcb-sync.so.1=libxcb-sync1 libxcb-util.so.1=libxcb-util1 libxcb-xfixes.so.0=libxcb-xfixes0
  libxcb-xkb.so.1=libxcb-xkb1"
# File -> package, of what the tests drive.
driven="/usr/bin/Xvfb=xvfb /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf=fonts-dejavu-core
  /usr/bin/indiserver=indi-bin /usr/bin/indi_eqmod_telescope=indi-eqmod /usr/bin/indi_starbook_telescope=indi-starbook
  /usr/bin/indi_gphoto_ccd=indi-gphoto /usr/bin/indi_lx200stargo=indi-avalon /usr/bin/indi_bresserexos2=indi-bresserexos2
  /usr/bin/faketime=faketime /usr/bin/localedef=locales /usr/share/i18n/locales/de_DE=locales /usr/bin/unshare=util-linux /usr/bin/pdftotext=poppler-utils
  /usr/bin/dbus-daemon=dbus-daemon /usr/libexec/at-spi-bus-launcher=at-spi2-core"

absent_libraries() {
  local known pair
  known=$(ldconfig -p 2>/dev/null)
  for pair in $libraries; do
    case "$known" in *"${pair%%=*} "*) ;; *) printf ' %s' "${pair#*=}" ;; esac
  done
  "$python" -c 'import ensurepip, venv' 2>/dev/null || printf ' python3-venv'
}

absent_driven() {
  local pair
  for pair in $driven; do [ -e "${pair%%=*}" ] || printf ' %s' "${pair#*=}"; done
  command -v ip >/dev/null || printf ' iproute2'
  /usr/bin/python3 -c 'import gi; gi.require_version("Atspi", "2.0")' 2>/dev/null || printf ' python3-gi gir1.2-atspi-2.0'
}

needed=$(absent_libraries)
wanted=
[ "$purpose" = test ] && wanted=$(absent_driven | xargs -n1 2>/dev/null | sort -u | xargs)
as_root=
if [ "$(id -u)" != 0 ]; then as_root="sudo -n"; fi

if [ -n "$needed$wanted" ] && command -v apt-get >/dev/null && { [ -z "$as_root" ] || sudo -n true 2>/dev/null; }; then
  echo "Installing with apt-get:$needed $wanted"
  install="$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends"
  $as_root apt-get update -qq >/dev/null 2>&1
  if [ -n "$needed" ]; then $install $needed >/dev/null 2>&1; fi
  # One by one where they do not all exist: a release without an INDI driver still has the screen.
  [ -z "$wanted" ] || $install $wanted >/dev/null 2>&1 ||
    for package in $wanted; do $install "$package" >/dev/null 2>&1; done
  needed=$(absent_libraries)
  [ -z "$wanted" ] || wanted=$(absent_driven | xargs -n1 2>/dev/null | sort -u | xargs)
fi
if [ "$purpose" = test ] && [ -z "$as_root" ] && command -v localedef >/dev/null && ! locale -a | grep -qix de_DE.utf8; then
  localedef -i de_DE -f UTF-8 de_DE.UTF-8 2>/dev/null
fi

if [ -n "$needed" ]; then
  echo "Kochab needs system libraries that are not here; install them with: sudo apt-get install$needed${wanted:+ $wanted}" >&2
  exit 1
fi
if [ -n "$wanted" ]; then
  echo "Some tests will be skipped; to run them all: sudo apt-get install $wanted" >&2
fi
exit 0
