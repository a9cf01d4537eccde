// What things in a file are called in lists and messages.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace octrace::scene {

// The name that the file gives, else "node 3".
template <class Items>
std::string name_of(const Items& items, std::size_t index, std::string_view kind) {
  const std::string& name = items[index].name;
  return name.empty() ? std::string(kind) + " " + std::to_string(index) : name;
}

// A name from a file as part of a message: one line, and no escape sequences for a terminal.
inline std::string printable(std::string name) {
  for (char& c : name) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  }
  return name;
}

}  // namespace octrace::scene
