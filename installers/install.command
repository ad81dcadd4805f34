#!/bin/sh
# Installs tankcal from the wheels beside this file, without a network, for this user.
cd "$(dirname "$0")" || exit 1
python=${PYTHON:-python@PYTHON@}
place=${TANKCAL_HOME:-$HOME/tankcal-app}
fail() {
  echo
  echo "$1"
  exit 1
}
PATH=$PATH:/Library/Frameworks/Python.framework/Versions/@PYTHON@/bin:/opt/homebrew/bin
command -v "$python" >/dev/null || fail "Python @PYTHON@ is required: python.org
Requer o Python @PYTHON@: python.org
Se requiere Python @PYTHON@: python.org"
echo "1/3 $place"
"$python" -m venv "$place" || fail "tankcal was not installed / não foi instalado / no se instaló"
echo "2/3 tankcal"
"$place/bin/python" -m pip install --quiet --disable-pip-version-check --no-index --no-compile \
  --find-links wheels --upgrade tankcal ||
  fail "tankcal was not installed / não foi instalado / no se instaló"
echo "3/3"
"$place/bin/python" -m tankcal app --shortcut
echo "tankcal is installed; open it by its shortcut.
O tankcal está instalado; abra-o pelo atalho.
tankcal está instalado; ábralo con el acceso directo."
