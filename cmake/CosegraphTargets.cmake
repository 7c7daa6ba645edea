# The project's own kinds of target. Every folder under components/ is one library,
# cosegraph_<folder>, seen as cosegraph::<folder>; its headers are included as "<folder>/x.hpp".

include(GoogleTest)

# Compiler settings that every target of the project shares.
add_library(cosegraph_settings INTERFACE)
target_compile_features(cosegraph_settings INTERFACE cxx_std_20)
target_compile_options(cosegraph_settings INTERFACE -Wall -Wextra -Wpedantic
                       -Wno-missing-field-initializers -ffp-contract=off
                       $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>)  # false alarms of GCC 12
if(COSEGRAPH_WERROR)
  target_compile_options(cosegraph_settings INTERFACE -Werror)
endif()
if(COSEGRAPH_SANITIZE)
  target_compile_options(cosegraph_settings INTERFACE -fsanitize=${COSEGRAPH_SANITIZE}
                                                      -fno-omit-frame-pointer)
  target_link_options(cosegraph_settings INTERFACE -fsanitize=${COSEGRAPH_SANITIZE})
  # Eigen would switch its allocator under the sanitizer, but the packaged PCL does not.
  target_compile_definitions(cosegraph_settings INTERFACE EIGEN_MALLOC_ALREADY_ALIGNED=1)
endif()

# add_component(NAME SOURCES x.cpp... [PUBLIC lib...] [PRIVATE lib...])
# PUBLIC: components whose headers its header includes. PRIVATE: what only its .cpp files see.
function(add_component name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(cosegraph_${name} STATIC ${ARG_SOURCES})
  add_library(cosegraph::${name} ALIAS cosegraph_${name})
  set_target_properties(cosegraph_${name} PROPERTIES CXX_EXTENSIONS OFF EXPORT_NAME ${name})
  target_include_directories(
    cosegraph_${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/components>
                             $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/cosegraph>)
  target_compile_features(cosegraph_${name} PUBLIC cxx_std_20)
  target_link_libraries(
    cosegraph_${name} PUBLIC ${ARG_PUBLIC} PRIVATE $<BUILD_INTERFACE:cosegraph_settings>
                                                   ${ARG_PRIVATE})
  set_property(GLOBAL APPEND PROPERTY COSEGRAPH_COMPONENTS cosegraph_${name})
endfunction()

# add_stage(KIND SOURCES x_stage.cpp [LIBS lib...])
# The DDS adapter of a component: an object library that defines `make_<KIND>_stage()`, the
# executable cosegraph-<KIND>, and an entry in the table that the cosegraph command is built with.
function(add_stage kind)
  cmake_parse_arguments(ARG "" "" "SOURCES;LIBS" ${ARGN})
  add_library(cosegraph_${kind}_stage STATIC ${ARG_SOURCES})
  set_target_properties(cosegraph_${kind}_stage PROPERTIES CXX_EXTENSIONS OFF)
  target_link_libraries(cosegraph_${kind}_stage PUBLIC cosegraph_graph
                                                PRIVATE cosegraph_settings ${ARG_LIBS})
  set(main ${CMAKE_CURRENT_BINARY_DIR}/${kind}_main.cpp)
  set(STAGE_KIND ${kind})
  configure_file(${PROJECT_SOURCE_DIR}/cmake/stage_main.cpp.in ${main} @ONLY)
  add_executable(cosegraph-${kind} ${main})
  set_target_properties(cosegraph-${kind} PROPERTIES CXX_EXTENSIONS OFF)
  target_link_libraries(cosegraph-${kind} PRIVATE cosegraph_${kind}_stage cosegraph_settings)
  install(TARGETS cosegraph-${kind})
  set_property(GLOBAL APPEND PROPERTY COSEGRAPH_STAGES ${kind})
endfunction()

# Against tests that hang, in seconds. Sanitizers make some ten times slower.
set(COSEGRAPH_TEST_TIMEOUT 300)
if(COSEGRAPH_SANITIZE)
  set(COSEGRAPH_TEST_TIMEOUT 1800)
  # Building runs no test program, so that only ctest needs the options of the sanitizers.
  set(CMAKE_GTEST_DISCOVER_TESTS_DISCOVERY_MODE PRE_TEST)
endif()

# The tests labelled "unit", without the programs that others run.
add_custom_target(unit_tests)

# add_unit_test(NAME SOURCES x_test.cpp... [LIBS lib...] [LABEL label] [SERIAL])
# One GoogleTest executable, <NAME>_test, with every test known to ctest. LABEL: "dds" for tests
# that start participants, "end_to_end" for those that run programs; without one a test is
# "unit". SERIAL: no other test at the same time. COSEGRAPH_DATA in the environment names the
# benchmark folder.
function(add_unit_test name)
  cmake_parse_arguments(ARG "SERIAL" "LABEL" "SOURCES;LIBS" ${ARGN})
  if(NOT ARG_LABEL)
    set(ARG_LABEL unit)
  endif()
  if(NOT ARG_SERIAL)
    set(ARG_SERIAL OFF)
  endif()
  add_executable(${name}_test ${ARG_SOURCES})
  set_target_properties(${name}_test PROPERTIES CXX_EXTENSIONS OFF RUNTIME_OUTPUT_DIRECTORY
                                                                  ${CMAKE_BINARY_DIR}/tests)
  # Tests are compiled once and run once: optimising them costs more than it gains.
  target_compile_options(${name}_test PRIVATE -O1)
  target_include_directories(${name}_test PRIVATE ${PROJECT_SOURCE_DIR}/tests)
  target_compile_definitions(
    ${name}_test PRIVATE COSEGRAPH_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
                         COSEGRAPH_BINARY_DIR="${CMAKE_BINARY_DIR}")
  target_link_libraries(${name}_test PRIVATE ${ARG_LIBS} GTest::gmock GTest::gtest_main
                                             cosegraph_settings)
  gtest_discover_tests(${name}_test TEST_PREFIX ${name}. PROPERTIES LABELS ${ARG_LABEL}
                       RUN_SERIAL ${ARG_SERIAL} TIMEOUT ${COSEGRAPH_TEST_TIMEOUT}
                       DISCOVERY_TIMEOUT 60)
  if(ARG_LABEL STREQUAL unit)
    add_dependencies(unit_tests ${name}_test)
  endif()
endfunction()
