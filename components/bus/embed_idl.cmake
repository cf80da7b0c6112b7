# cmake -DOUTPUT=... -DIDL_FOLDER=... -P embed_idl.cmake
# Writes embedded_idl.cpp: all of the IDL as text.
include("${CMAKE_CURRENT_LIST_DIR}/../../cmake/embedded_text.cmake")
file(GLOB idl_files "${IDL_FOLDER}/*.idl")
set(idl "")
foreach(idl_file ${idl_files})
  file(READ "${idl_file}" text)
  string(APPEND idl "${text}")
endforeach()
write_embedded_text("${OUTPUT}" embedded_idl.hpp trigpoint::bus embedded_idl "${idl}")
