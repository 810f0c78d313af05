# efsi_compile_options(target): warnings and floating-point rules of every target of the project; no file holds the place of
# the checkout.
function(efsi_compile_options target)
  target_compile_options(${target} PRIVATE "-ffile-prefix-map=${PROJECT_SOURCE_DIR}/=")
  target_compile_options(${target} PRIVATE -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow)
  if(EFSI_STRICT)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
