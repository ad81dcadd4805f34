#!/usr/bin/env bash
# dist/tankcal-VERSION.exe: the installer for Windows, from the wheels of installers/offline.py and the
# embeddable Python of python.org (python-3.12.*-embed-amd64.zip), which no package index has.
#   installers/windows.sh PYTHON.zip
# Without PYTHON.zip the script of the installer is only checked: its result, in build/, cannot run.
set -euo pipefail
cd "$(dirname "$0")"
stage=$PWD/../build/windows
wheels=$PWD/../build/offline/windows/wheels
version=$(basename "$wheels"/tankcal-*.whl | cut -d- -f2)
site=$stage/python/Lib/site-packages
rm -rf "$stage" && mkdir -p "$site"
if [ $# -gt 0 ]; then
  python3 -m zipfile -e "$1" "$stage/python"
  # the embeddable Python has a list of folders in place of a search path
  echo Lib/site-packages >>"$(ls "$stage"/python/python3*._pth)"
  out=$PWD/../dist/tankcal-$version.exe
else
  some=tankcal-*
  out=$PWD/../build/tankcal-without-python.exe
fi
for wheel in "$wheels"/${some:-*}.whl; do python3 -m zipfile -e "$wheel" "$site"; done
shopt -s nullglob
for data in "$site"/*.data; do # files that a wheel puts outside of its package
  for part in purelib platlib; do if [ -d "$data/$part" ]; then cp -r "$data/$part/." "$site"; fi; done
  rm -rf "$data"
done
mkdir -p "$(dirname "$out")"
makensis -V2 "-DVERSION=$version" "-DSTAGE=$stage" "-DOUT=$out" tankcal.nsi
rm -rf "$stage"
echo "$out: $(du -m "$out" | cut -f1) MB"
