; The installer: makensis -DVERSION=0.2.0 -DFOLDER=dist/kochab -DOUT=kochab-0.2.0-windows-x64.exe kochab.nsi
;
; For one person, without an administrator. Silent: SETUP.exe /S [/D=C:\Some where], uninstall.exe /S [/FORGET].
; Removal takes all that was installed and the cache (an index of half a GB); settings, equipment profiles and the journal
; are the person's, and go when asked for: by the question, or silently by /FORGET.
Target amd64-unicode ; as the program; and Wine need not run 32 bits
!include MUI2.nsh
!include FileFunc.nsh
!include LogicLib.nsh

!define KEY "Software\Microsoft\Windows\CurrentVersion\Uninstall\Kochab"
!define CLASSES "Software\Classes"
!define PATHS "Software\Microsoft\Windows\CurrentVersion\App Paths"

Name "Kochab"
OutFile "${OUT}"
InstallDir "$LOCALAPPDATA\Programs\Kochab"
InstallDirRegKey HKCU "${KEY}" "InstallLocation"
RequestExecutionLevel user
!ifdef QUICK
SetCompress off
!else
SetCompressor /SOLID lzma
!endif
VIProductVersion "${VERSION}.0"
VIAddVersionKey ProductName "Kochab"
VIAddVersionKey ProductVersion "${VERSION}"
VIAddVersionKey FileVersion "${VERSION}"
VIAddVersionKey FileDescription "Kochab plate solving, polar alignment and mounts"
VIAddVersionKey LegalCopyright "GPL-3.0-or-later"

!define MUI_ICON "${ICON}"
!define MUI_UNICON "${ICON}"
!define MUI_FINISHPAGE_RUN "$INSTDIR\kochab-window.exe"
!insertmacro MUI_PAGE_DIRECTORY
!insertmacro MUI_PAGE_INSTFILES
!insertmacro MUI_PAGE_FINISH
!insertmacro MUI_UNPAGE_CONFIRM
!insertmacro MUI_UNPAGE_INSTFILES
!insertmacro MUI_LANGUAGE "English"

; A program that runs cannot be replaced: its file does not open for writing.
!macro EndIfRunning PROGRAM
  ${If} ${FileExists} "$INSTDIR\${PROGRAM}"
    ClearErrors
    FileOpen $0 "$INSTDIR\${PROGRAM}" a
    ${If} ${Errors}
      MessageBox MB_OK|MB_ICONEXCLAMATION "Kochab is running. Close it, then try again." /SD IDOK
      SetErrorLevel 3
      Quit
    ${EndIf}
    FileClose $0
  ${EndIf}
!macroend

!macro OpenWith ENDING
  WriteRegStr HKCU "${CLASSES}\.${ENDING}\OpenWithProgids" "Kochab.Image" ""
  WriteRegStr HKCU "${CLASSES}\Applications\kochab-window.exe\SupportedTypes" ".${ENDING}" ""
!macroend
!macro NoOpenWith ENDING
  DeleteRegValue HKCU "${CLASSES}\.${ENDING}\OpenWithProgids" "Kochab.Image"
  DeleteRegKey /ifempty HKCU "${CLASSES}\.${ENDING}\OpenWithProgids"
  DeleteRegKey /ifempty HKCU "${CLASSES}\.${ENDING}"
!macroend
!macro EachEnding DO
  !insertmacro ${DO} fits
  !insertmacro ${DO} fit
  !insertmacro ${DO} fts
  !insertmacro ${DO} xisf
  !insertmacro ${DO} tif
  !insertmacro ${DO} tiff
  !insertmacro ${DO} jpg
  !insertmacro ${DO} jpeg
!macroend

Section
  SetShellVarContext current
  !insertmacro EndIfRunning kochab-window.exe
  !insertmacro EndIfRunning kochab.exe
  RMDir /r "$INSTDIR\program" ; no module of an older version may stay
  SetOutPath "$INSTDIR"
  File /r "${FOLDER}\*"
  WriteUninstaller "$INSTDIR\uninstall.exe"
  CreateShortcut "$SMPROGRAMS\Kochab.lnk" "$INSTDIR\kochab-window.exe"

  WriteRegStr HKCU "${CLASSES}\Kochab.Image" "" "Image of the sky"
  WriteRegStr HKCU "${CLASSES}\Kochab.Image\DefaultIcon" "" "$INSTDIR\kochab-window.exe,0"
  WriteRegStr HKCU "${CLASSES}\Kochab.Image\shell\open\command" "" '"$INSTDIR\kochab-window.exe" "%1"'
  WriteRegStr HKCU "${CLASSES}\Applications\kochab-window.exe" "FriendlyAppName" "Kochab"
  WriteRegStr HKCU "${CLASSES}\Applications\kochab-window.exe\shell\open\command" "" '"$INSTDIR\kochab-window.exe" "%1"'
  !insertmacro EachEnding OpenWith
  WriteRegStr HKCU "${PATHS}\kochab.exe" "" "$INSTDIR\kochab.exe"
  WriteRegStr HKCU "${PATHS}\kochab-window.exe" "" "$INSTDIR\kochab-window.exe"

  WriteRegStr HKCU "${KEY}" "DisplayName" "Kochab"
  WriteRegStr HKCU "${KEY}" "DisplayVersion" "${VERSION}"
  WriteRegStr HKCU "${KEY}" "DisplayIcon" "$INSTDIR\kochab-window.exe"
  WriteRegStr HKCU "${KEY}" "InstallLocation" "$INSTDIR"
  WriteRegStr HKCU "${KEY}" "UninstallString" '"$INSTDIR\uninstall.exe"'
  WriteRegStr HKCU "${KEY}" "QuietUninstallString" '"$INSTDIR\uninstall.exe" /S'
  WriteRegDWORD HKCU "${KEY}" "NoModify" 1
  WriteRegDWORD HKCU "${KEY}" "NoRepair" 1
  ${GetSize} "$INSTDIR" "/S=0K" $0 $1 $2
  WriteRegDWORD HKCU "${KEY}" "EstimatedSize" $0
  System::Call 'shell32::SHChangeNotify(i 0x08000000, i 0, p 0, p 0)' ; Explorer reads the kinds of files again
SectionEnd

Section Uninstall
  SetShellVarContext current
  !insertmacro EndIfRunning kochab-window.exe
  !insertmacro EndIfRunning kochab.exe
  ; What was installed, by name: the folder may be one that a person chose, with files of theirs in it.
  RMDir /r "$INSTDIR\program"
  Delete "$INSTDIR\kochab.exe"
  Delete "$INSTDIR\kochab-window.exe"
  Delete "$INSTDIR\uninstall.exe"
  RMDir "$INSTDIR"
  RMDir "$LOCALAPPDATA\Programs" ; if nothing else is in it
  Delete "$SMPROGRAMS\Kochab.lnk"
  DeleteRegKey HKCU "${CLASSES}\Kochab.Image"
  DeleteRegKey HKCU "${CLASSES}\Applications\kochab-window.exe"
  !insertmacro EachEnding NoOpenWith
  DeleteRegKey HKCU "${PATHS}\kochab.exe"
  DeleteRegKey HKCU "${PATHS}\kochab-window.exe"
  DeleteRegKey HKCU "${KEY}"
  System::Call 'shell32::SHChangeNotify(i 0x08000000, i 0, p 0, p 0)'

  RMDir /r "$LOCALAPPDATA\kochab\Cache"
  ${GetParameters} $0
  ClearErrors
  ${GetOptions} $0 "/FORGET" $1
  ${IfNot} ${Errors}
    RMDir /r "$LOCALAPPDATA\kochab"
  ${ElseIf} ${FileExists} "$LOCALAPPDATA\kochab\*.*"
    MessageBox MB_YESNO "Remove your settings, equipment profiles and the journal too?" /SD IDNO IDNO +2
    RMDir /r "$LOCALAPPDATA\kochab"
  ${EndIf}
  RMDir "$LOCALAPPDATA\kochab" ; if nothing is in it
  ; astropy makes these; other programs may keep something in them, and then they stay.
  RMDir "$PROFILE\.astropy\config"
  RMDir "$PROFILE\.astropy"
SectionEnd
