# cmake -DOUTPUT=... -DPAGE_FOLDER=... -P embed.cmake
# Writes embedded.cpp: index.html with the scripts that it names put in place.
include("${CMAKE_CURRENT_LIST_DIR}/../../cmake/embedded_text.cmake")
file(READ "${PAGE_FOLDER}/index.html" page)
file(GLOB scripts "${PAGE_FOLDER}/*.js")
foreach(script ${scripts})
  get_filename_component(name "${script}" NAME)
  file(READ "${script}" text)
  string(REPLACE "<script src=\"${name}\"></script>" "<script>\n${text}</script>" page "${page}")
endforeach()
if(page MATCHES "<script src=")
  message(FATAL_ERROR "index.html names a script that is not beside it")
endif()
write_embedded_text("${OUTPUT}" embedded.hpp trigpoint::live embedded_page "${page}")
