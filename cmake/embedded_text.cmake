# For scripts that make text a part of a program: include(), then
# write_embedded_text(OUTPUT HEADER NAMESPACE FUNCTION TEXT) writes a source file in which
# NAMESPACE::FUNCTION(), declared in HEADER, returns TEXT.
function(write_embedded_text output header namespace function text)
  file(WRITE "${output}"
"// Written by embedded_text.cmake.
#include \"${header}\"

namespace ${namespace} {

std::string_view ${function}() {
  return R\"embedded~(${text})embedded~\";
}

}  // namespace ${namespace}
")
endfunction()
