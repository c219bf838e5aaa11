# What `cmake --install` installs: the packages have the same files, by the components imud, imud-dev and python3-imud.
# Headers of the libraries are internal, and the libraries are not installed.
include(GNUInstallDirs)
set(packaging ${CMAKE_SOURCE_DIR}/tools/packaging)

install(TARGETS imud imu-allan imu-campaign imu-decode imu-fit imu-plot imu-truth COMPONENT imud)
# The manual and the completions are made of what the programs state of themselves.
file(GLOB makers CONFIGURE_DEPENDS ${packaging}/documents/*.py ${CMAKE_SOURCE_DIR}/tools/scenarios/*.toml)
add_custom_command(OUTPUT ${CMAKE_BINARY_DIR}/documents.stamp
  COMMAND /usr/bin/python3 ${packaging}/documents/documents.py ${CMAKE_BINARY_DIR} ${CMAKE_SOURCE_DIR}
    ${CMAKE_BINARY_DIR}/documents ${CMAKE_CROSSCOMPILING_EMULATOR}
  COMMAND ${CMAKE_COMMAND} -E touch ${CMAKE_BINARY_DIR}/documents.stamp
  DEPENDS imud imu-allan imu-campaign imu-decode imu-fit imu-plot imu-truth ${makers} ${packaging}/debian/changelog
    emulator/CONFIGURATION.md emulator/control/README.md emulator/faults/README.md
  VERBATIM)
add_custom_target(documents ALL DEPENDS ${CMAKE_BINARY_DIR}/documents.stamp)
set(documents ${CMAKE_BINARY_DIR}/documents)
install(DIRECTORY ${documents}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT imud)
install(DIRECTORY ${documents}/bash/ DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT imud)
install(DIRECTORY ${documents}/zsh/ DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT imud)
install(DIRECTORY ${documents}/fish/ DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT imud)

install(FILES ${packaging}/debian/copyright DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT imud)
install(FILES tools/lockstep_client.hpp tools/realtime_client.hpp DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/imud
  COMPONENT imud-dev)

# The files of files.txt keep their paths, by which --help, messages and the README.md files name them.
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${packaging}/files.txt)
set(listed "")
file(STRINGS ${packaging}/files.txt lines REGEX "^[^#]")
foreach(line IN LISTS lines)
  string(REGEX MATCH "^([^ ]+) +([^ ]+)$" is_row "${line}")
  if(NOT is_row)
    message(FATAL_ERROR "tools/packaging/files.txt: \"${line}\" is no package and path")
  endif()
  set(package ${CMAKE_MATCH_1})
  set(pattern ${CMAKE_MATCH_2})
  set(found ${pattern})
  if(pattern MATCHES "\\*")
    file(GLOB_RECURSE found RELATIVE ${CMAKE_SOURCE_DIR} CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/${pattern})
    list(FILTER found EXCLUDE REGEX "__pycache__")
  endif()
  if(NOT found)
    message(FATAL_ERROR "tools/packaging/files.txt: there is no ${pattern}")
  endif()
  foreach(file IN LISTS found)
    if(file IN_LIST listed)
      message(FATAL_ERROR "tools/packaging/files.txt: ${pattern} has ${file}, which an earlier line has")
    endif()
    list(APPEND listed ${file})
    get_filename_component(folder ${file} DIRECTORY)
    file(READ ${file} begin LIMIT 2 HEX)
    set(kind FILES)
    if(begin STREQUAL "2321")
      set(kind PROGRAMS)
    endif()
    install(${kind} ${file} DESTINATION ${CMAKE_INSTALL_DATADIR}/imud/${folder} COMPONENT ${package})
  endforeach()
endforeach()

# The Python package, where Debian's interpreter finds it below /usr/local.
execute_process(COMMAND /usr/bin/python3 -c "import sys; print(*sys.version_info[:2], sep='.')"
  OUTPUT_VARIABLE python_version OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
set(IMUD_PYTHON_FOLDER lib/python${python_version}/dist-packages CACHE STRING "Where the Python package is installed")
file(GLOB modules CONFIGURE_DEPENDS ${CMAKE_SOURCE_DIR}/tools/python/imud/*.py)
install(FILES ${modules} DESTINATION ${IMUD_PYTHON_FOLDER}/imud COMPONENT python3-imud)

# The service imud@NAME, and what it needs of the system. Debian's package has limits.conf in /etc/security.
install(FILES ${packaging}/system/imud@.service DESTINATION lib/systemd/system COMPONENT imud)
install(FILES ${packaging}/system/imud-user@.service DESTINATION lib/systemd/user RENAME imud@.service COMPONENT imud)
foreach(kind sysusers tmpfiles)
  install(FILES ${packaging}/system/${kind}.conf DESTINATION lib/${kind}.d RENAME imud.conf COMPONENT imud)
endforeach()
install(FILES ${packaging}/system/udev.rules DESTINATION lib/udev/rules.d RENAME 60-imud.rules COMPONENT imud)
install(FILES ${packaging}/system/limits.conf DESTINATION ${CMAKE_INSTALL_SYSCONFDIR}/security/limits.d RENAME imud.conf
  COMPONENT imud)

# Not tests: packages of this build, examined by lintian, in packages/; whether another build, in other circumstances, gives
# the same; and, as root, what a bare Debian does with them; the set for a machine without network; and the image for
# containers, in image/, which is then run.
add_custom_target(packages COMMAND ${packaging}/build-packages ${CMAKE_BINARY_DIR} DEPENDS documents USES_TERMINAL VERBATIM)
add_custom_target(reproduce COMMAND ${packaging}/reproduce --against ${CMAKE_BINARY_DIR} ${CMAKE_BINARY_DIR}/reproduce
  DEPENDS documents USES_TERMINAL VERBATIM)
add_custom_target(check_packages COMMAND ${packaging}/check-packages ${CMAKE_BINARY_DIR}/packages USES_TERMINAL VERBATIM)
add_custom_target(offline_packages COMMAND ${packaging}/offline-packages ${CMAKE_BINARY_DIR}/packages
  ${CMAKE_BINARY_DIR}/offline USES_TERMINAL VERBATIM)
add_custom_target(image COMMAND ${packaging}/build-image ${CMAKE_BINARY_DIR}/packages ${CMAKE_BINARY_DIR}/image
  COMMAND ${packaging}/check-image ${CMAKE_BINARY_DIR}/image/imud-docker.tar
  COMMAND ${packaging}/check-image ${CMAKE_BINARY_DIR}/image/imud-oci.tar USES_TERMINAL VERBATIM)
