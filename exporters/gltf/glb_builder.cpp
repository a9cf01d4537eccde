#include "exporters/gltf/glb_builder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace octrace::exporters {

namespace {

using Json = nlohmann::ordered_json;

constexpr int kFloat = 5126, kUnsignedShort = 5123, kUnsignedInt = 5125;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr const char* kTypes[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};

template <class T>
std::span<const std::uint8_t> bytes_of(std::span<const T> values) {
  return {reinterpret_cast<const std::uint8_t*>(values.data()), values.size_bytes()};
}

void append_word(std::string& out, std::uint64_t word) {
  const auto value = static_cast<std::uint32_t>(word);
  for (int shift = 0; shift < 32; shift += 8) out += static_cast<char>(value >> shift & 0xffu);
}

}  // namespace

int GlbBuilder::add_view(std::span<const std::uint8_t> bytes, Target target) {
  binary_.resize((binary_.size() + 3) / 4 * 4, '\0');
  Json view{{"buffer", 0}, {"byteOffset", binary_.size()}, {"byteLength", bytes.size()}};
  if (target == Target::vertices) view["target"] = kArrayBuffer;
  if (target == Target::indices) view["target"] = kElementArrayBuffer;
  binary_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  return add("bufferViews", std::move(view));
}

int GlbBuilder::add_floats(std::span<const float> values, int components, bool bounds) {
  const auto step = static_cast<std::size_t>(components);
  Json accessor{{"bufferView", add_view(bytes_of(values), Target::vertices)},
                {"componentType", kFloat},
                {"count", values.size() / step},
                {"type", kTypes[components]}};
  if (bounds) {
    std::vector<float> lower(values.begin(), values.begin() + components);
    std::vector<float> upper = lower;
    for (std::size_t i = 0; i < values.size(); ++i) {
      lower[i % step] = std::min(lower[i % step], values[i]);
      upper[i % step] = std::max(upper[i % step], values[i]);
    }
    accessor["min"] = lower;
    accessor["max"] = upper;
  }
  return add("accessors", std::move(accessor));
}

int GlbBuilder::add_indices(std::span<const std::uint32_t> indices, std::uint32_t vertex_count) {
  // 65535 itself would mean "start anew" and may not be an index.
  const bool is_short = vertex_count <= 65535;
  int view = 0;
  if (is_short) {
    const std::vector<std::uint16_t> words(indices.begin(), indices.end());
    view = add_view(bytes_of(std::span<const std::uint16_t>(words)), Target::indices);
  } else {
    view = add_view(bytes_of(indices), Target::indices);
  }
  return add("accessors", Json{{"bufferView", view},
                               {"componentType", is_short ? kUnsignedShort : kUnsignedInt},
                               {"count", indices.size()},
                               {"type", "SCALAR"}});
}

void GlbBuilder::use_extension(const std::string& name) {
  Json& used = json_["extensionsUsed"];
  for (const Json& known : used) {
    if (known == name) return;
  }
  used.push_back(name);
}

util::Result<std::string> GlbBuilder::finish(const std::string& path) {
  binary_.resize((binary_.size() + 3) / 4 * 4, '\0');
  if (!binary_.empty()) json_["buffers"] = Json::array({Json{{"byteLength", binary_.size()}}});
  std::string text = json_.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const std::uint64_t binary_chunk = binary_.empty() ? 0 : 8 + std::uint64_t{binary_.size()};
  const std::uint64_t total = 12 + 8 + std::uint64_t{text.size()} + binary_chunk;
  if (total > 0xffffffffull) {
    return util::Error{util::Exit::unsupported, "",
                       fmt::format("needs {} bytes, a .glb holds at most {}", total, 0xffffffffull),
                       path, ""};
  }
  std::string file;
  file.reserve(total);
  file += "glTF";
  append_word(file, 2);
  append_word(file, total);
  append_word(file, text.size());
  file += "JSON";
  file += text;
  if (binary_chunk > 0) {
    append_word(file, binary_.size());
    file.append("BIN\0", 4);
    file += binary_;
  }
  return file;
}

}  // namespace octrace::exporters
