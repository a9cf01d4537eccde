// Reads a ZIP archive in memory from its directory, for tests: every length and checksum of both
// headers is compared, and what does not agree throws.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

namespace octrace::test {

std::map<std::string, std::string> read_zip(std::string_view archive);

}  // namespace octrace::test
