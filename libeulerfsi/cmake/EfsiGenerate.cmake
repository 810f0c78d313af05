# efsi_generate(target): a target that writes what follows from parameters.toml and the C headers (generate.py): the
# C++ into EFSI_GENERATED, a folder to include from, and what Python, Houdini and the reference read beside their
# sources, where .gitignore has it. As a part of another project the latter is left out; in a wheel it goes to
# EFSI_GENERATED too.
option(EFSI_GENERATE_TREE "Write the generated files of Python, Houdini and the reference into the checkout"
       ${PROJECT_IS_TOP_LEVEL})
set(EFSI_GENERATED "${CMAKE_CURRENT_BINARY_DIR}/generated")

function(efsi_generate target)
  find_package(Python3 3.11 REQUIRED COMPONENTS Interpreter)
  cmake_path(GET CMAKE_CURRENT_FUNCTION_LIST_DIR PARENT_PATH library)
  cmake_path(GET library PARENT_PATH root)
  set(generator "${library}/generate.py")
  file(GLOB modules CONFIGURE_DEPENDS "${library}/faces/*.py")
  file(GLOB headers CONFIGURE_DEPENDS "${library}/include/eulerfsi/*.h")
  file(GLOB templates CONFIGURE_DEPENDS "${root}/houdini_hda/*.template")
  set(presets "${root}/usd_plugin/eulerfsi_usd/presets.json")
  set(arguments --sources "${EFSI_GENERATED}")
  set(written "${EFSI_GENERATED}/frame/parameter_table.inc" "${EFSI_GENERATED}/capi/struct_fields.inc")
  if(EFSI_GENERATE_TREE OR SKBUILD)
    set(tree "${root}")
    if(SKBUILD)
      set(tree "${EFSI_GENERATED}")
    endif()
    set(asset "${tree}/houdini_hda/otls/eulerfsi_solver.hda/eulerfsi_8_8Sop_1solver_8_81.0")
    list(APPEND arguments --tree "${tree}")
    list(APPEND written "${tree}/batch/eulerfsi/solver/c_api.py" "${tree}/usd_plugin/eulerfsi_usd/parameters.json"
         "${tree}/usd_plugin/eulerfsi_usd/schema/generatedSchema.usda"
         "${tree}/usd_plugin/eulerfsi_usd/schema/plugInfo.json" "${asset}/DialogScript" "${asset}/Help"
         "${tree}/docs/reference/parameters.rst")
  endif()
  # A file that would not change keeps its date, so that nothing is compiled again; the stamp has that of the last run.
  set(stamp "${CMAKE_CURRENT_BINARY_DIR}/generated.stamp")
  add_custom_command(OUTPUT "${stamp}" BYPRODUCTS ${written}
    COMMAND "${Python3_EXECUTABLE}" -B "${generator}" ${arguments}
    COMMAND "${CMAKE_COMMAND}" -E touch "${stamp}"
    DEPENDS "${generator}" ${modules} ${headers} ${templates} "${presets}" "${library}/parameters.toml"
    COMMENT "Generating from parameters.toml and the C headers" VERBATIM)
  add_custom_target(${target} DEPENDS "${stamp}")
endfunction()
