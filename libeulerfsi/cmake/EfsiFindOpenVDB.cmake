# Finds OpenVDB: by a configuration of its own where there is one (vcpkg), else by the find module that it installs below
# lib, lib64 or the multiarch folder of its prefix (Debian, Fedora, Arch, conda). -DCMAKE_PREFIX_PATH=... adds prefixes,
# -DOpenVDB_ROOT=... names one.
find_package(OpenVDB CONFIG QUIET)
if(NOT OpenVDB_FOUND)
  set(places)
  foreach(prefix IN LISTS OpenVDB_ROOT CMAKE_PREFIX_PATH CMAKE_SYSTEM_PREFIX_PATH)
    foreach(lib IN ITEMS "lib/${CMAKE_LIBRARY_ARCHITECTURE}" lib64 lib)
      list(APPEND places "${prefix}/${lib}/cmake/OpenVDB")
    endforeach()
  endforeach()
  find_path(EFSI_OPENVDB_MODULE FindOpenVDB.cmake PATHS ${places} NO_DEFAULT_PATH
            DOC "Folder of the find module that OpenVDB installs")
  if(NOT EFSI_OPENVDB_MODULE)
    list(JOIN places "\n  " text)
    message(FATAL_ERROR "OpenVDB was not found. Install it (libopenvdb-dev, openvdb-devel) or name its prefix with "
                        "-DOpenVDB_ROOT=... Looked for FindOpenVDB.cmake in\n  ${text}")
  endif()
  list(APPEND CMAKE_MODULE_PATH "${EFSI_OPENVDB_MODULE}")
  find_package(OpenVDB REQUIRED)
endif()
