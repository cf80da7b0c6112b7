# Functions that every component uses, so that targets look alike.

# The programs of the bus and the tests labelled bus or system: what a second vendor changes, so what
# `tests/run --bus` builds and runs. All else never sees a vendor.
add_custom_target(trigpoint_on_the_bus)

# Warnings for our own code; third-party headers come in as SYSTEM.
# -Wno-restrict: g++ 12 reports string concatenation falsely (GCC bug 105651).
# -Wno-subobject-linkage: g++ takes a source file that another one includes, as in a unity build, for a
# header, in which a member of a type without a name outside would be a mistake.
function(trigpoint_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wconversion -Wshadow -Wnon-virtual-dtor
                                           -Woverloaded-virtual -Wno-restrict $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>
                                           $<$<BOOL:${TRIGPOINT_WERROR}>:-Werror>)
endfunction()

# trigpoint_library(<name> SOURCES ... [PUBLIC libs...] [PRIVATE libs...])
# Library trigpoint_<name>, alias trigpoint::<name>, public headers in include/trigpoint/<name>.
function(trigpoint_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  set(target trigpoint_${name})
  add_library(${target} STATIC ${ARG_SOURCES})
  add_library(trigpoint::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name} POSITION_INDEPENDENT_CODE ON)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/include/*.hpp)
  target_sources(${target} PUBLIC FILE_SET HEADERS BASE_DIRS ${CMAKE_CURRENT_SOURCE_DIR}/include FILES ${headers})
  target_include_directories(${target} PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)
  target_link_libraries(${target} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  trigpoint_warnings(${target})
  install(TARGETS ${target} EXPORT trigpoint-targets FILE_SET HEADERS)
endfunction()

# trigpoint_program(<name> SOURCES ... LIBS ...): an installed executable.
function(trigpoint_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
  trigpoint_warnings(${name})
  install(TARGETS ${name})
endfunction()

# trigpoint_bus_program(<name> SOURCES ... LIBS ... [OUTPUT_NAME ...] [DEFINITIONS ...]): a program on
# the bus, installed as TRIGPOINT_DDS says. For the tests it is there once more in bin/<vendor> for
# each other vendor: compiled once, linked again, so TRIGPOINT_BIN=bin/<vendor> runs the job on it.
function(trigpoint_bus_program name)
  cmake_parse_arguments(ARG "" "OUTPUT_NAME" "SOURCES;LIBS;DEFINITIONS" ${ARGN})
  if(NOT ARG_OUTPUT_NAME)
    set(ARG_OUTPUT_NAME ${name})
  endif()
  add_library(${name}_objects OBJECT ${ARG_SOURCES})
  target_link_libraries(${name}_objects PRIVATE ${ARG_LIBS} trigpoint::bus_core)
  target_compile_definitions(${name}_objects PRIVATE ${ARG_DEFINITIONS})
  trigpoint_warnings(${name}_objects)
  trigpoint_program(${name} SOURCES $<TARGET_OBJECTS:${name}_objects> LIBS ${ARG_LIBS} trigpoint::bus)
  set_target_properties(${name} PROPERTIES OUTPUT_NAME ${ARG_OUTPUT_NAME} LINKER_LANGUAGE CXX)
  if(NOT TRIGPOINT_BUILD_TESTS)
    return()
  endif()
  set_property(GLOBAL APPEND PROPERTY TRIGPOINT_BUS_PROGRAMS_${TRIGPOINT_DDS} ${name})
  add_dependencies(trigpoint_on_the_bus ${name})
  foreach(vendor ${TRIGPOINT_DDS_VENDORS})
    if(TARGET trigpoint::bus_${vendor} AND NOT vendor STREQUAL TRIGPOINT_DDS)
      add_executable(${name}_${vendor} $<TARGET_OBJECTS:${name}_objects>)
      target_link_libraries(${name}_${vendor} PRIVATE ${ARG_LIBS} trigpoint::bus_${vendor})
      set_target_properties(${name}_${vendor} PROPERTIES OUTPUT_NAME ${ARG_OUTPUT_NAME} LINKER_LANGUAGE CXX
                            RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin/${vendor})
      set_property(GLOBAL APPEND PROPERTY TRIGPOINT_BUS_PROGRAMS_${vendor} ${name}_${vendor})
    endif()
  endforeach()
endfunction()

# How a test is compiled.
function(trigpoint_test_compilation target)
  # A test is compiled more often than its time matters; at -O1 g++ 12 takes the payload of an empty
  # std::optional for uninitialised (GCC bug 80635).
  target_compile_options(${target} PRIVATE -O1 $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_compile_definitions(${target} PRIVATE TRIGPOINT_SHARED_DATA="${TRIGPOINT_SHARED_DATA}" TRIGPOINT_SOURCE_DIR="${PROJECT_SOURCE_DIR}" TRIGPOINT_BIN_DIR="${CMAKE_BINARY_DIR}/bin")
  trigpoint_warnings(${target})
endfunction()

# trigpoint_test(<name> SOURCES ... LIBS ... [LABELS ...] [TIMEOUT s]): one GoogleTest binary in
# bin/, each TEST a ctest of its own, or all as one with WHOLE (then it runs alone). The label "long"
# keeps a test out of the default run.
function(trigpoint_test name)
  cmake_parse_arguments(ARG "WHOLE" "TIMEOUT" "SOURCES;LIBS;LABELS" ${ARGN})
  if(NOT TRIGPOINT_BUILD_TESTS)
    return()
  endif()
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} GTest::gmock GTest::gtest_main)
  trigpoint_test_compilation(${name})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin LINKER_LANGUAGE CXX)
  if("bus" IN_LIST ARG_LABELS OR "system" IN_LIST ARG_LABELS)
    add_dependencies(trigpoint_on_the_bus ${name})
  endif()
  if(ARG_WHOLE)
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}" RUN_SERIAL ON)
    return()
  endif()
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST PROPERTIES TIMEOUT ${ARG_TIMEOUT} LABELS "${ARG_LABELS}")
endfunction()

# trigpoint_objects(<name> SOURCES ... LIBS ... [TEST]): code of the tests that several targets link,
# compiled once; they name $<TARGET_OBJECTS:<name>> among their sources. TEST: compiled as a test is.
function(trigpoint_objects name)
  cmake_parse_arguments(ARG "TEST" "" "SOURCES;LIBS" ${ARGN})
  add_library(${name} OBJECT EXCLUDE_FROM_ALL ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS})
  if(ARG_TEST)
    target_link_libraries(${name} PRIVATE GTest::gmock)
    trigpoint_test_compilation(${name})
  else()
    trigpoint_warnings(${name})
  endif()
endfunction()
