; Installer for Windows: Python (the embeddable package of python.org) with tankcal, for this user,
; without administrator rights. Built by installers/windows.sh on Linux.
Unicode true
!include "MUI2.nsh"
!ifndef VERSION
  !error "makensis -DVERSION=0.1.0 -DSTAGE=folder -DOUT=file.exe"
!endif
Name "tankcal"
OutFile "${OUT}"
InstallDir "$LOCALAPPDATA\Programs\tankcal"
RequestExecutionLevel user
!define KEY "Software\Microsoft\Windows\CurrentVersion\Uninstall\tankcal"

!insertmacro MUI_PAGE_LICENSE "../LICENSE"
!insertmacro MUI_PAGE_DIRECTORY
!insertmacro MUI_PAGE_INSTFILES
!insertmacro MUI_UNPAGE_CONFIRM
!insertmacro MUI_UNPAGE_INSTFILES
!insertmacro MUI_LANGUAGE "English"
!insertmacro MUI_LANGUAGE "PortugueseBR"
!insertmacro MUI_LANGUAGE "Spanish"

LangString OPEN ${LANG_ENGLISH} "Open in tankcal"
LangString OPEN ${LANG_PORTUGUESEBR} "Abrir no tankcal"
LangString OPEN ${LANG_SPANISH} "Abrir en tankcal"

Section
  SetOutPath "$INSTDIR"
  RMDir /r "$INSTDIR\python" ; modules of an earlier version
  File /r "${STAGE}/*"
  WriteUninstaller "$INSTDIR\uninstall.exe"
  SetOutPath "$DOCUMENTS" ; working folder of the shortcuts
  CreateShortcut "$SMPROGRAMS\tankcal.lnk" "$INSTDIR\python\python.exe" "-m tankcal app"
  CreateShortcut "$DESKTOP\tankcal.lnk" "$INSTDIR\python\python.exe" "-m tankcal app"
  WriteRegStr HKCU "Software\Classes\Directory\shell\tankcal" "" "$(OPEN)"
  WriteRegStr HKCU "Software\Classes\Directory\shell\tankcal\command" "" '"$INSTDIR\python\python.exe" -m tankcal app "%1"'
  WriteRegStr HKCU "${KEY}" "DisplayName" "tankcal"
  WriteRegStr HKCU "${KEY}" "DisplayVersion" "${VERSION}"
  WriteRegStr HKCU "${KEY}" "UninstallString" '"$INSTDIR\uninstall.exe"'
  WriteRegDWORD HKCU "${KEY}" "NoModify" 1
  WriteRegDWORD HKCU "${KEY}" "NoRepair" 1
SectionEnd

Section "Uninstall" ; jobs are in the documents of the user and remain
  Delete "$SMPROGRAMS\tankcal.lnk"
  Delete "$DESKTOP\tankcal.lnk"
  DeleteRegKey HKCU "Software\Classes\Directory\shell\tankcal"
  DeleteRegKey HKCU "${KEY}"
  RMDir /r "$INSTDIR\python"
  Delete "$INSTDIR\uninstall.exe"
  RMDir "$INSTDIR"
SectionEnd
