# Flags and helpers shared by all targets of this project.

set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)

# Flags that our own targets share and that no user of the library inherits.
add_library(loci_flags INTERFACE)
target_compile_options(loci_flags INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor
  -Wold-style-cast -Woverloaded-virtual -Wdouble-promotion
  -ffp-contract=off  # the same sum on every machine: replay must be bit-identical
  # -Wrestrict cries wolf over "text" + std::string at -O3 in GCC 12 (its bug 105329).
  $<$<CXX_COMPILER_ID:GNU>:-Wduplicated-cond -Wlogical-op -Wno-restrict>
  $<$<CXX_COMPILER_ID:Clang>:-Wthread-safety>
  $<$<BOOL:${LOCI_WERROR}>:-Werror>)
if(LOCI_SANITIZE)
  target_compile_options(loci_flags INTERFACE
    -fsanitize=${LOCI_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
  target_link_options(loci_flags INTERFACE -fsanitize=${LOCI_SANITIZE})
  if(LOCI_SANITIZE STREQUAL "thread")
    # Asio has fences beside atomics; GCC says of each that TSan does not follow it.
    target_compile_options(loci_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-tsan>)
  endif()
endif()

# loci_add_library(core SOURCES a.cc HEADERS a.h PUBLIC Eigen3::Eigen PRIVATE Ceres::ceres)
# makes the static library loci::core. Where the variable LOCI_EXPORT_SET names a set, the library is
# installed with its headers and exported in it; other libraries are parts of our programs only.
function(loci_add_library name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "" "SOURCES;HEADERS;PUBLIC;PRIVATE")
  add_library(loci_${name} STATIC ${ARG_SOURCES})
  add_library(loci::${name} ALIAS loci_${name})
  target_sources(loci_${name} PUBLIC FILE_SET HEADERS
    BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ARG_HEADERS})
  target_compile_features(loci_${name} PUBLIC cxx_std_20)
  set_target_properties(loci_${name} PROPERTIES
    CXX_EXTENSIONS OFF EXPORT_NAME ${name} VERIFY_INTERFACE_HEADER_SETS ON)
  target_link_libraries(loci_${name}
    PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} $<BUILD_INTERFACE:loci_flags>)
  if(LOCI_EXPORT_SET)
    install(TARGETS loci_${name} EXPORT ${LOCI_EXPORT_SET}
      FILE_SET HEADERS DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/loci)
  endif()
endfunction()

# loci_add_test(core_mesh_tests LABELS unit SOURCES a_test.cc PRIVATE loci::core)
# makes one test program and registers each of its tests with ctest. The target loci_tests_LABEL builds
# all test programs with that label. Label those that start threads `threads`: CI runs them under TSan.
function(loci_add_test name)
  cmake_parse_arguments(PARSE_ARGV 1 ARG "" "TIMEOUT" "LABELS;SOURCES;PRIVATE" )
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE ${ARG_PRIVATE} loci_flags GTest::gmock GTest::gtest_main)
  # At -O3 GCC 12 sees overlaps in inlined strings and values of Eigen without a beginning that are none
  # (its bugs 105651 and 105562); what is true of it, the dev preset says too.
  target_compile_options(${name} PRIVATE
    "$<$<AND:$<CXX_COMPILER_ID:GNU>,$<CONFIG:Release>>:-Wno-restrict;-Wno-maybe-uninitialized>")
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/tests)
  foreach(label IN LISTS ARG_LABELS)
    if(NOT TARGET loci_tests_${label})
      add_custom_target(loci_tests_${label})
    endif()
    add_dependencies(loci_tests_${label} ${name})
  endforeach()
  # gtest_discover_tests takes lists in PROPERTIES apart: labels are set by a file that ctest reads.
  gtest_discover_tests(${name} TEST_PREFIX "" DISCOVERY_TIMEOUT 60 TEST_LIST ${name}_list
    PROPERTIES TIMEOUT ${ARG_TIMEOUT})
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${name}_labels.cmake
    "if(${name}_list)\n"
    "  set_tests_properties(\${${name}_list} PROPERTIES LABELS \"${ARG_LABELS}\")\n"
    "endif()\n")
  set_property(DIRECTORY APPEND PROPERTY
    TEST_INCLUDE_FILES ${CMAKE_CURRENT_BINARY_DIR}/${name}_labels.cmake)
endfunction()
