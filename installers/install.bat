@echo off
rem Installs tankcal from the wheels beside this file, without a network, for this user.
chcp 65001 >nul
cd /d "%~dp0"
set "place=%LOCALAPPDATA%\Programs\tankcal"
py -@PYTHON@ -c "import struct; exit(struct.calcsize('P') != 8)" >nul 2>nul
if errorlevel 1 goto python
echo 1/3 %place%
py -@PYTHON@ -m venv "%place%"
if errorlevel 1 goto failed
echo 2/3 tankcal
"%place%\Scripts\python" -m pip install --quiet --disable-pip-version-check --no-index --no-compile --find-links wheels --upgrade tankcal
if errorlevel 1 goto failed
echo 3/3
"%place%\Scripts\python" -m tankcal app --shortcut
echo tankcal is installed; open it by its shortcut.
echo O tankcal está instalado; abra-o pelo atalho.
echo tankcal está instalado; ábralo con el acceso directo.
pause
exit /b 0
:python
echo Python @PYTHON@ of 64 bits is required: python.org
echo Requer o Python @PYTHON@ de 64 bits: python.org
echo Se requiere Python @PYTHON@ de 64 bits: python.org
pause
exit /b 1
:failed
echo tankcal was not installed / não foi instalado / no se instaló
pause
exit /b 1
