# efsi_compile_options(target): warnings and floating-point rules of every target of the project; no file holds the place of
# the checkout.
function(efsi_compile_options target)
  target_compile_options(${target} PRIVATE "-ffile-prefix-map=${PROJECT_SOURCE_DIR}/=")
  target_compile_options(${target} PRIVATE -fno-fast-math -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow)
  # Two that -ffp-contract=off does not reach (docs/numerics/build-flags.md). Eigen's own vector code fuses a*b+c and
  # sums in another order where it may use AVX or NEON. GCC's vectoriser of straight-line code fuses (a*b+c, a*b-c) where the
  # processor may be taken to do so.
  target_compile_definitions(${target} PRIVATE EIGEN_DONT_VECTORIZE)
  string(TOUPPER "CMAKE_CXX_FLAGS_${CMAKE_BUILD_TYPE}" of_build_type)
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND "${CMAKE_CXX_FLAGS} ${${of_build_type}}" MATCHES " -m(arch|avx|fma)")
    target_compile_options(${target} PRIVATE -fno-tree-slp-vectorize)
  endif()
  # Nothing reads errno, which keeps loops with a sqrt from being vectorised. Short vectors (grid/packed_field.hpp) are
  # passed between inlined functions only.
  target_compile_options(${target} PRIVATE -fno-math-errno $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>)
  if(EFSI_STRICT)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()

# efsi_unity(target): with EFSI_UNITY its sources are compiled up to seven at a time, those of one folder together. Names of
# their anonymous namespaces must differ. Alone stay sources with hot loops (base/kernel.hpp), so that what is inlined into
# these does not depend on their neighbours, and those with OpenVDB's templates, whose compilation takes a GB and more.
function(efsi_unity target)
  if(NOT EFSI_UNITY)
    return()
  endif()
  set(folders "")
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    file(STRINGS "${source}" alone REGEX "EFSI_KERNEL|#include <openvdb/" LIMIT_COUNT 1)
    cmake_path(GET source PARENT_PATH folder)
    cmake_path(RELATIVE_PATH folder BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    string(MAKE_C_IDENTIFIER "${folder}" folder)
    if(NOT alone)
      list(APPEND folders "${folder}")
      list(APPEND sources_of_${folder} "${source}")
    endif()
  endforeach()
  list(REMOVE_DUPLICATES folders)
  foreach(folder IN LISTS folders)
    list(LENGTH sources_of_${folder} count)
    math(EXPR batches "(${count} + 6) / 7")
    math(EXPR size "(${count} + ${batches} - 1) / ${batches}")  # batches of one folder are alike
    set(at 0)
    foreach(source IN LISTS sources_of_${folder})
      math(EXPR batch "${at} / ${size}")
      math(EXPR at "${at} + 1")
      set_source_files_properties("${source}" PROPERTIES UNITY_GROUP "${folder}_${batch}")
    endforeach()
  endforeach()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_MODE GROUP)
endfunction()

# Parsed once instead of in every source, and by the tests too: half of the time of a build. Sources include what they use
# all the same: CMAKE_DISABLE_PRECOMPILE_HEADERS (preset debug) builds without.
set(EFSI_PRECOMPILED <algorithm> <array> <cmath> <cstdint> <functional> <limits> <memory> <optional> <span> <sstream>
                     <string> <utility> <vector> <Eigen/Dense> <Eigen/Geometry>)
