# Every header compiles alone, so that no file depends on the order of its includes.
#
# A header with a .cpp is the first that this includes (layering_test.py). For each of the others one
# source of one line is compiled into an object library that nobody links. They are found by globbing,
# here and nowhere else: a list would let a new header escape.
# A header of ours needs no third-party library (layering_test.py), hence no include path but ours.
file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE ${PROJECT_SOURCE_DIR}
  ${PROJECT_SOURCE_DIR}/scheduler/*.h ${PROJECT_SOURCE_DIR}/formats/*.h
  ${PROJECT_SOURCE_DIR}/stages/*.h ${PROJECT_SOURCE_DIR}/pipeline/*.h
  ${PROJECT_SOURCE_DIR}/tools/*.h ${PROJECT_SOURCE_DIR}/tests/*.h ${PROJECT_SOURCE_DIR}/perf/*.h)
# Of npm packages.
list(FILTER headers EXCLUDE REGEX "/node_modules/")

set(sources)
foreach(header IN LISTS headers)
  string(REGEX REPLACE "h$" "cpp" own_source ${PROJECT_SOURCE_DIR}/${header})
  if(EXISTS ${own_source})
    continue()
  endif()
  string(MAKE_C_IDENTIFIER ${header} name)
  set(source ${CMAKE_CURRENT_BINARY_DIR}/header_check/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "#include \"${header}\"\n")
  list(APPEND sources ${source})
endforeach()

add_library(header_check OBJECT ${sources})
if(QMPIPE_SANITIZE)
  set_target_properties(header_check PROPERTIES EXCLUDE_FROM_ALL ON)  # the dev build has done it
endif()
# Headers of tests/ and perf/ may use GoogleTest.
target_link_libraries(header_check PRIVATE qmpipe_flags GTest::gmock)
# Nothing of it runs.
target_compile_options(header_check PRIVATE -O0 -g0)
# The analysis of clang-tidy is done where a header is used.
set_target_properties(header_check PROPERTIES CXX_CLANG_TIDY "")
