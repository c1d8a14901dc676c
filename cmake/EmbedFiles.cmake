# Run at build time: cmake -DOUTPUT=x.cc -DHEADER=a/b.h -DFUNCTION=Files -DFILES=path|type|file,... -P
# Writes a C++ file whose FUNCTION returns the files' contents as StaticFile (server/http/map_routes.h).
string(REPLACE "," ";" FILES "${FILES}")
set(arrays "")
set(entries "")
set(number 0)
foreach(entry IN LISTS FILES)
  string(REPLACE "|" ";" entry "${entry}")
  list(GET entry 0 path)
  list(GET entry 1 type)
  list(GET entry 2 file)
  if(path STREQUAL "/")
    set(path "")
  endif()
  file(READ "${file}" hex HEX)
  string(REGEX REPLACE "(..)" "'\\\\x\\1'," bytes "${hex}")
  string(REGEX REPLACE "(('[^']*',)('[^']*',)('[^']*',)('[^']*',)('[^']*',)('[^']*',)('[^']*',)('[^']*',))"
    "\\1\n" bytes "${bytes}")
  string(APPEND arrays "constexpr char kFile${number}[] = {\n${bytes}};\n")
  string(APPEND entries
    "    {\"${path}\", \"${type}\", std::string_view(kFile${number}, sizeof(kFile${number}))},\n")
  math(EXPR number "${number} + 1")
endforeach()
file(WRITE "${OUTPUT}" "#include \"${HEADER}\"

#include <array>
#include <string_view>

namespace loci {
namespace {

${arrays}
constexpr std::array<StaticFile, ${number}> kFiles = {{
${entries}}};

}  // namespace

std::span<const StaticFile> ${FUNCTION}() {
  return kFiles;
}

}  // namespace loci
")
