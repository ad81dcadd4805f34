#!/usr/bin/env bash
# dist/tankcal-linux.tar.gz: a folder that runs without Python, built by PyInstaller from a wheel, and
# tried: the example, and the app with a job that is computed in it.
#   installers/frozen.sh dist/tankcal-*.whl
set -euo pipefail
wheel=$(realpath "$1")
cd "$(dirname "$0")/.."
work=$PWD/build/frozen
rm -rf "$work" && mkdir -p "$work/trial"
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --no-compile -c constraints.txt "$wheel" pyinstaller
"$work/venv/bin/pyinstaller" --log-level ERROR --noconfirm --distpath "$work" \
  --workpath "$work/work" installers/tankcal.spec
rm -rf "$work/venv" "$work/work"
du -sm "$work/tankcal" | sed 's/\t.*/ MB: a folder of tankcal with Python/'
env -i HOME="$work/trial" "$work/tankcal/tankcal" demo --quiet --out "$work/trial/demo"
env -i HOME="$work/trial" "$work/tankcal/tankcal" verify "$work/trial/demo"
.venv/bin/python installers/try_app.py "$work/tankcal/tankcal"
mkdir -p dist && tar -C "$work" -czf dist/tankcal-linux.tar.gz tankcal && rm -rf "$work"
