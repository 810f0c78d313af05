# Run after a Catch2 program is linked: writes OUTPUT, a CTest file with one test per test case of PROGRAM.
# Inputs: PROGRAM, LABEL, OUTPUT, CATCH_VERSION.
if(CATCH_VERSION VERSION_LESS 3)
  set(list_names --list-test-names-only)
  set(run_arguments "--warn NoTests") # version 2 calls an empty run a success otherwise
else()
  set(list_names --list-tests --verbosity quiet)
  set(run_arguments "")
endif()

# test_names(<out> [tag]): names of all test cases, or of those with a tag.
function(test_names out)
  execute_process(COMMAND "${PROGRAM}" ${ARGN} ${list_names} OUTPUT_VARIABLE text RESULT_VARIABLE status)
  if(NOT status MATCHES "^[0-9]+$") # version 2 returns the number of tests
    message(FATAL_ERROR "${PROGRAM} ${list_names}: ${status}")
  endif()
  string(STRIP "${text}" text)
  # CMake's lists give these characters a meaning; they come back when a name is written.
  string(REPLACE ";" "<semicolon>" text "${text}")
  string(REPLACE "[" "<open>" text "${text}")
  string(REPLACE "]" "<close>" text "${text}")
  string(REPLACE "\n" ";" names "${text}")
  set(${out} "${names}" PARENT_SCOPE)
endfunction()

function(restore_name out name)
  string(REPLACE "<semicolon>" ";" name "${name}")
  string(REPLACE "<open>" "[" name "${name}")
  string(REPLACE "<close>" "]" name "${name}")
  set(${out} "${name}" PARENT_SCOPE)
endfunction()

test_names(tests)
execute_process(COMMAND "${PROGRAM}" --list-tags OUTPUT_VARIABLE tag_text)
string(REGEX MATCHALL "\\[[a-z][a-z0-9_-]*\\]" tags "${tag_text}")
foreach(tag IN LISTS tags)
  test_names(tagged "${tag}")
  string(REGEX REPLACE "[][]" "" word "${tag}")
  foreach(test IN LISTS tagged)
    list(APPEND "labels_of_${test}" "${word}")
  endforeach()
endforeach()

set(script "")
foreach(test IN LISTS tests)
  set(labels "${LABEL}" ${labels_of_${test}})
  list(REMOVE_DUPLICATES labels)
  restore_name(name "${test}")
  string(REGEX REPLACE "([],[])" "\\\\\\1" spec "${name}") # Catch2 reads commas and brackets as patterns
  string(APPEND script "add_test([==[${LABEL}: ${name}]==] [==[${PROGRAM}]==] [==[${spec}]==] ${run_arguments})\n"
                       "set_tests_properties([==[${LABEL}: ${name}]==] PROPERTIES LABELS \"${labels}\" TIMEOUT 900)\n")
endforeach()
file(WRITE "${OUTPUT}" "${script}")
