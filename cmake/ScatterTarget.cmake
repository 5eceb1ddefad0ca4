# One CMake target per folder: scatter_library(protocol SOURCES a.cpp b.cpp DEPENDS ...) makes
# scatter_protocol with the alias scatter::protocol. Includes are written from the repository's root.
function(scatter_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  add_library(scatter_${name} STATIC ${ARG_SOURCES})
  add_library(scatter::${name} ALIAS scatter_${name})
  target_include_directories(scatter_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_compile_features(scatter_${name} PUBLIC cxx_std_23)
  target_link_libraries(scatter_${name} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS} scatter_warnings)
endfunction()

# scatter_test(name SOURCES ... DEPENDS ...): a Catch2 program whose test cases ctest lists one by one.
function(scatter_test name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} scatter_test_main scatter_warnings)
  add_test(NAME ${name} COMMAND ${name} WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  if(name MATCHES "^unit_(protocol|firmware|device|formats|images|memory)")
    scatter_sanitize_too(${name} ${name})
  endif()
endfunction()

# scatter_sanitize_too(test target): joins the tests that ./run test --preset asan-ubsan builds and
# runs: those of the code that reads bytes from outside or hands out memory, where an error of memory would hide.
add_custom_target(sanitized_tests)
function(scatter_sanitize_too test target)
  set_tests_properties(${test} PROPERTIES LABELS sanitized)
  add_dependencies(sanitized_tests ${target})
endfunction()
