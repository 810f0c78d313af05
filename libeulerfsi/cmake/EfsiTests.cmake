# efsi_add_test_program(target LABEL label SOURCES file...): a Catch2 program of the sources and efsi_tests_common; each of
# its test cases becomes a CTest test named "<label>: <test case>" with the label and one label per Catch2 tag ([law] ->
# law, [slow] -> slow).
function(efsi_add_test_program target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" "LABEL" "SOURCES")
  add_executable(${target} ${arg_SOURCES})
  efsi_compile_options(${target})
  efsi_unity(${target})
  target_link_libraries(${target} PRIVATE efsi_tests_common)
  target_precompile_headers(${target} REUSE_FROM efsi_tests_common)

  set(list_file "${CMAKE_CURRENT_BINARY_DIR}/${target}_tests.cmake")
  add_custom_command(TARGET ${target} POST_BUILD
    COMMAND "${CMAKE_COMMAND}" "-DPROGRAM=$<TARGET_FILE:${target}>" "-DLABEL=${arg_LABEL}" "-DOUTPUT=${list_file}"
            "-DCATCH_VERSION=${Catch2_VERSION}" -P "${PROJECT_SOURCE_DIR}/libeulerfsi/cmake/list_tests.cmake"
    BYPRODUCTS "${list_file}" VERBATIM)
  # A program that was not built shows up as a test that fails.
  file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/${target}_include.cmake"
       "if(EXISTS \"${list_file}\")\n  include(\"${list_file}\")\nelse()\n  add_test(\"${target} is built\" false)\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES "${CMAKE_CURRENT_BINARY_DIR}/${target}_include.cmake")
endfunction()
