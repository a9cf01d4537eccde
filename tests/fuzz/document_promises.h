// What load() promises about a document it accepts, checked the slow way.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace octrace::tests {

// Loads `bytes`; refused is fine. Returns "" or the promise that was broken.
std::string broken_promise(const std::vector<std::uint8_t>& bytes, const std::string& name);

}  // namespace octrace::tests
