# cmake -DOUTPUT=... -DIDL_FOLDER=... -P embed_idl.cmake
# Writes embedded_idl.cpp: all of the IDL as text.
file(GLOB idl_files "${IDL_FOLDER}/*.idl")
set(idl "")
foreach(idl_file ${idl_files})
  file(READ "${idl_file}" text)
  string(APPEND idl "${text}")
endforeach()
file(WRITE "${OUTPUT}"
"// Written by embed_idl.cmake.
#include \"embedded_idl.hpp\"

namespace trigpoint::bus {

std::string_view embedded_idl() {
  return R\"embedded~(${idl})embedded~\";
}

}  // namespace trigpoint::bus
")
