// KHR_mesh_quantization: which types each attribute may have, and what their values mean.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/compression/encode.h"
#include "tests/compression/same.h"
#include "tests/malformed/base_scene.h"

namespace octrace::tests {
namespace {

using nlohmann::json;

struct Format {
  int component;
  bool normalized;
  const char* name;
};
constexpr Format kFormats[] = {
    {5126, false, "float"},
    {5120, false, "byte"},
    {5120, true, "byte_normalised"},
    {5121, false, "ubyte"},
    {5121, true, "ubyte_normalised"},
    {5122, false, "short"},
    {5122, true, "short_normalised"},
    {5123, false, "ushort"},
    {5123, true, "ushort_normalised"},
    {5125, false, "uint"},
};

// The tables of glTF and, `extended`, of the extension, by the names above.
struct Row {
  const char* attribute;
  const char* type;
  const char* morph_type;
  std::vector<std::string> core, extended, core_morph, extended_morph;
};
const std::vector<Row>& rows() {
  static const std::vector<Row> kRows = {
      {"POSITION",
       "VEC3",
       "VEC3",
       {"float"},
       {"byte", "byte_normalised", "ubyte", "ubyte_normalised", "short", "short_normalised",
        "ushort", "ushort_normalised"},
       {"float"},
       {"byte", "byte_normalised", "short", "short_normalised"}},
      {"NORMAL",
       "VEC3",
       "VEC3",
       {"float"},
       {"byte_normalised", "short_normalised"},
       {"float"},
       {"byte_normalised", "short_normalised"}},
      {"TANGENT",
       "VEC4",
       "VEC3",
       {"float"},
       {"byte_normalised", "short_normalised"},
       {"float"},
       {"byte_normalised", "short_normalised"}},
      {"TEXCOORD_0",
       "VEC2",
       "VEC2",
       {"float", "ubyte_normalised", "ushort_normalised"},
       {"byte", "byte_normalised", "ubyte", "short", "short_normalised", "ushort"},
       {"float", "ubyte_normalised", "ushort_normalised", "byte_normalised", "short_normalised"},
       {"byte", "short"}},  // as the Khronos validator has it; the extension's text leaves it out
      {"COLOR_0",
       "VEC4",
       "VEC4",
       {"float", "ubyte_normalised", "ushort_normalised"},
       {},
       {"float", "ubyte_normalised", "ushort_normalised", "byte_normalised", "short_normalised"},
       {}},
  };
  return kRows;
}

int components(const std::string& type) { return type.back() - '0'; }

double largest(int component) {
  switch (component) {
    case 5120:
      return 127.0;
    case 5121:
      return 255.0;
    case 5122:
      return 32767.0;
    default:
      return 65535.0;
  }
}

// Three elements, each aligned to four bytes as attributes must be, and what they say.
struct Values {
  Bytes bytes;
  std::size_t stride = 0;
  std::vector<float> expected;
};
Values values_of(const Format& format, int count_of_components) {
  Values out;
  const int raw[12] = {1, 100, 5, 127, 0, 3, 64, 2, 99, 126, 17, 1};
  const bool is_signed = format.component == 5120 || format.component == 5122;
  for (int v = 0; v < 3; ++v) {
    Bytes element;
    for (int c = 0; c < count_of_components; ++c) {
      const int i = v * count_of_components + c;
      // The lowest of all once: it lies beyond -1 before it is clamped.
      int value = is_signed && i % 2 == 1 ? -raw[i] : raw[i];
      if (is_signed && i == 3) value = format.component == 5120 ? -128 : -32768;
      const auto add = [&](auto number) {
        const auto* p = reinterpret_cast<const std::uint8_t*>(&number);
        element.insert(element.end(), p, p + sizeof number);
      };
      if (format.component == 5126) add(static_cast<float>(value));
      if (format.component == 5120) add(static_cast<std::int8_t>(value));
      if (format.component == 5121) add(static_cast<std::uint8_t>(value));
      if (format.component == 5122) add(static_cast<std::int16_t>(value));
      if (format.component == 5123) add(static_cast<std::uint16_t>(value));
      if (format.component == 5125) add(static_cast<std::uint32_t>(value));
      const double number =
          format.normalized ? std::max(value / largest(format.component), -1.0) : value;
      out.expected.push_back(static_cast<float>(number));
    }
    element.resize((element.size() + 3) / 4 * 4);
    out.stride = element.size();
    out.bytes.insert(out.bytes.end(), element.begin(), element.end());
  }
  return out;
}

Parts with_attribute(const Row& row, const Format& format, bool morph, bool extended,
                     std::vector<float>& expected) {
  Parts parts;
  parts.root = base_scene();
  parts.bin = base_buffer();
  parts.root["buffers"][0].erase("uri");
  if (extended) use_extension(parts.root, "KHR_mesh_quantization");
  const std::string type = morph ? row.morph_type : row.type;
  const Values values = values_of(format, components(type));
  expected = values.expected;
  const int view = parts.append_view(values.bytes);
  parts.root["bufferViews"][static_cast<std::size_t>(view)]["byteStride"] = values.stride;
  json accessor = {
      {"bufferView", view}, {"componentType", format.component}, {"count", 3}, {"type", type}};
  if (format.normalized) accessor["normalized"] = true;
  parts.root["accessors"].push_back(accessor);
  json& primitive = parts.root["meshes"][0]["primitives"][0];
  json& attributes = primitive["attributes"];
  if (morph) {
    if (!attributes.contains(row.attribute)) {  // the base that it morphs
      const Values floats = values_of(kFormats[0], components(row.type));
      const int base = parts.append_view(floats.bytes);
      parts.root["accessors"].push_back(
          {{"bufferView", base}, {"componentType", 5126}, {"count", 3}, {"type", row.type}});
      attributes[row.attribute] = 11;
    }
    primitive["targets"][0] = {{row.attribute, 10}};
  } else {
    attributes[row.attribute] = 10;
  }
  return parts;
}

TEST(Quantization, TypesAreThoseOfTheTable) {
  int accepted = 0, refused = 0;
  for (const Row& row : rows()) {
    for (const Format& format : kFormats) {
      for (const bool morph : {false, true}) {
        for (const bool extended : {false, true}) {
          SCOPED_TRACE(std::string(row.attribute) + " " + format.name + (morph ? " morph" : "") +
                       (extended ? " extended" : ""));
          const auto listed = [&](const std::vector<std::string>& names) {
            return std::find(names.begin(), names.end(), format.name) != names.end();
          };
          const bool allowed = listed(morph ? row.core_morph : row.core) ||
                               (extended && listed(morph ? row.extended_morph : row.extended));
          std::vector<float> expected;
          const Parts parts = with_attribute(row, format, morph, extended, expected);
          const auto document = gltf::load_bytes(parts.glb(), "quantised.glb", {});
          ASSERT_EQ(static_cast<bool>(document), allowed)
              << (document ? "accepted" : document.error().to_string());
          if (!document) {
            ++refused;
            EXPECT_EQ(document.error().code, "MESH_PRIMITIVE_ATTRIBUTES_ACCESSOR_INVALID_FORMAT");
            continue;
          }
          ++accepted;
          const auto values = document->read_floats(10);
          ASSERT_EQ(values.size(), expected.size());
          for (std::size_t i = 0; i < values.size(); ++i) {
            EXPECT_FLOAT_EQ(values[i], expected[i]) << i;
          }
        }
      }
    }
  }
  EXPECT_GT(accepted, 60);
  EXPECT_GT(refused, 60);
}

// Positions of each mesh as UNSIGNED_SHORT on a grid over its bounds, which its node undoes;
// normals as BYTE normalised.
struct Grid {
  double origin[3], step;
};
void quantise(Parts& parts, double& largest_step) {
  const auto document = gltf::load_bytes(parts.glb(), "plain.glb", {});
  ASSERT_TRUE(document);
  json& root = parts.root;
  for (json& node : root["nodes"]) {
    if (!node.contains("mesh")) continue;
    ASSERT_FALSE(node.contains("matrix") || node.contains("translation"));
    const auto m = node["mesh"].get<std::size_t>();
    Grid grid{{0, 0, 0}, 0};
    double high[3] = {};
    bool first = true;
    for (const auto& primitive : document->model.meshes[m].primitives) {
      const auto values = document->read_floats(primitive.attributes.at("POSITION"));
      for (std::size_t i = 0; i < values.size(); ++i) {
        const std::size_t c = i % 3;
        grid.origin[c] = first && i < 3 ? values[i] : std::min<double>(grid.origin[c], values[i]);
        high[c] = first && i < 3 ? values[i] : std::max<double>(high[c], values[i]);
      }
      first = false;
    }
    for (int c = 0; c < 3; ++c) grid.step = std::max(grid.step, (high[c] - grid.origin[c]) / 65535);
    largest_step = std::max(largest_step, grid.step);
    for (std::size_t p = 0; p < document->model.meshes[m].primitives.size(); ++p) {
      const auto& primitive = document->model.meshes[m].primitives[p];
      const auto store = [&](const char* name, const Bytes& bytes, int stride, json accessor) {
        const int view = parts.append_view(bytes);
        root["bufferViews"][static_cast<std::size_t>(view)]["byteStride"] = stride;
        accessor["bufferView"] = view;
        accessor["count"] = bytes.size() / static_cast<std::size_t>(stride);
        accessor["type"] = "VEC3";
        root["accessors"].push_back(accessor);
        root["meshes"][m]["primitives"][p]["attributes"][name] = root["accessors"].size() - 1;
      };
      Bytes positions, normals;
      const auto add = [](Bytes& bytes, int value) {
        bytes.push_back(static_cast<std::uint8_t>(value));
        bytes.push_back(static_cast<std::uint8_t>(value >> 8));
      };
      const auto values = document->read_floats(primitive.attributes.at("POSITION"));
      for (std::size_t i = 0; i < values.size(); ++i) {
        add(positions, static_cast<int>(std::lround((values[i] - grid.origin[i % 3]) / grid.step)));
        if (i % 3 == 2) add(positions, 0);
      }
      store("POSITION", positions, 8, {{"componentType", 5123}});
      if (!primitive.attributes.contains("NORMAL")) continue;
      const auto directions = document->read_floats(primitive.attributes.at("NORMAL"));
      for (std::size_t i = 0; i < directions.size(); ++i) {
        normals.push_back(static_cast<std::uint8_t>(
            static_cast<std::int8_t>(std::lround(directions[i] * 127.0f))));
        if (i % 3 == 2) normals.push_back(0);
      }
      store("NORMAL", normals, 4, {{"componentType", 5120}, {"normalized", true}});
    }
    node["translation"] = grid.origin;
    node["scale"] = {grid.step, grid.step, grid.step};
  }
  use_extension(root, "KHR_mesh_quantization");
}

TEST(Quantization, ScenesStayWithinHalfAStep) {
  for (const char* name : {"default", "paper"}) {
    SCOPED_TRACE(name);
    Parts parts = parts_of_builtin(name);
    const scene::Scene plain = flattened(parts);
    double step = 0.0;
    ASSERT_NO_FATAL_FAILURE(quantise(parts, step));
    const scene::Scene quantised = flattened(parts);
    ASSERT_EQ(quantised.positions.size(), plain.positions.size());
    for (std::size_t v = 0; v < plain.positions.size(); ++v) {
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(quantised.positions[v][c], plain.positions[v][c],
                    0.501 * step + 1e-6 * std::abs(plain.positions[v][c]));
      }
    }
    for (std::size_t n = 0; n < plain.normals.size(); ++n) {
      for (int c = 0; c < 3; ++c) {
        ASSERT_NEAR(quantised.normals[n][c], plain.normals[n][c], 1.0 / 127);
      }
    }
    EXPECT_TRUE(same_bits(quantised.triangles, plain.triangles));
    const Difference found = compare_pictures(plain, quantised, 1e-3);
    EXPECT_GT(found.covered, found.pixels / 16);
    EXPECT_LE(found.masks + found.objects + found.depths, found.covered / 200);
  }
}

}  // namespace
}  // namespace octrace::tests
