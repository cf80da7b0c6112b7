# cmake -DOUTPUT=... -DPAGE_FOLDER=... -P embed.cmake
# Writes embedded.cpp: index.html with the scripts that it names put in place.
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
file(WRITE "${OUTPUT}"
"// Written by embed.cmake.
#include \"embedded.hpp\"

namespace trigpoint::live {

std::string_view embedded_page() {
  return R\"embedded~(${page})embedded~\";
}

}  // namespace trigpoint::live
")
