#include "backend/image/image.h"

#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <optional>
#include <thread>

#include "backend/image/module.h"
#include "backend/util/atomic_file.h"
#include "backend/util/heap.h"
#include "backend/util/version.h"

namespace octrace::image {

namespace {

struct Loaded {
  const ModuleTable* table = nullptr;
  util::Error error;
};

// Beside the program (a bundle), in the lib folder next to its own (an installation, the build
// tree), or wherever the system looks.
std::vector<std::string> module_candidates() {
  std::vector<std::string> candidates;
  std::error_code error;
  const std::filesystem::path program = std::filesystem::read_symlink("/proc/self/exe", error);
  if (!error) {
    const std::filesystem::path folder = program.parent_path();
    candidates.push_back((folder / kModuleFile).string());
    candidates.push_back((folder.parent_path() / "lib" / kModuleFile).string());
    candidates.push_back((folder.parent_path() / "lib" / "octrace" / kModuleFile).string());
  }
  candidates.emplace_back(kModuleFile);
  return candidates;
}

util::Error load_error(const std::string& message) {
  return {util::Exit::io, "IMAGE_LIBRARY", message, "", ""};
}

// A library's symbols are looked for in all libraries that are opened with it: in 258 for each of
// libopenvdb's 68,000, which is most of the time that the module takes to load. Opened before it, a
// library is searched with those alone that it needs itself. One that cannot be opened here is left
// to the module, which asks for it again or for another version.
void open_libraries() {
  constexpr const char* kOrder[] = {
#include "library_order.inc"
      nullptr};
  for (const char* const* name = kOrder; *name != nullptr; ++name) {
    ::dlopen(*name, RTLD_LAZY | RTLD_LOCAL);
  }
}

Loaded load() {
  for (const std::string& candidate : module_candidates()) {
    if (candidate.find('/') != std::string::npos && ::access(candidate.c_str(), F_OK) != 0)
      continue;
    open_libraries();
    // RTLD_LAZY: binding the symbols of some 250 libraries at once costs as much as mapping them.
    void* handle = ::dlopen(candidate.c_str(), RTLD_LAZY | RTLD_LOCAL);
    if (handle == nullptr) {
      const char* reason = ::dlerror();
      return {nullptr, load_error(fmt::format("the image library cannot be loaded: {}", reason))};
    }
    const auto entry = reinterpret_cast<ModuleEntry>(::dlsym(handle, kModuleSymbol));
    const ModuleTable* table = entry != nullptr ? entry() : nullptr;
    if (table == nullptr || std::strcmp(table->version, util::version()) != 0) {
      return {nullptr, load_error(fmt::format("{} belongs to octrace {}, this is {}", candidate,
                                              table != nullptr ? table->version : "(unknown)",
                                              util::version()))};
    }
    return {table, {}};
  }
  return {nullptr, load_error(fmt::format("{} was not found beside the program", kModuleFile))};
}

std::atomic<bool> preload_begun{false};

std::mutex threads_mutex;
std::optional<unsigned> requested_threads;
const ModuleTable* ready = nullptr;

Loaded load_with_threads() {
  Loaded loaded = load();
  const std::lock_guard lock(threads_mutex);
  ready = loaded.table;
  if (ready != nullptr && requested_threads) ready->set_threads(*requested_threads);
  return loaded;
}

const Loaded& module() {
  static const Loaded loaded = load_with_threads();
  return loaded;
}

// fill(path) writes the image to path; the file appears under its own name only when complete.
template <class Fill>
util::Result<void> write_atomically(const std::string& path, const Fill& fill) {
  util::Result<util::AtomicFile> file = util::AtomicFile::create(path);
  if (!file) return file.error();
  util::Result<void> filled = fill(file->temporary());
  if (!filled) {
    filled.error().file = path;
    return filled;
  }
  return file->commit();
}

}  // namespace

const Image::Plane* Image::find(const std::string& name) const {
  const auto found = std::find_if(planes.begin(), planes.end(),
                                  [&](const Plane& plane) { return plane.name == name; });
  return found == planes.end() ? nullptr : &*found;
}

// OpenImageIO takes 24 MB in small pieces as it is loaded.
constexpr std::size_t kLibraryHeap = std::size_t{28} << 20;

void preload() {
  preload_begun = true;
  std::thread([] {
    util::prepare_heap(kLibraryHeap);
    module();
  }).detach();
}

void finish_preload() {
  if (preload_begun) module();
}

util::Result<void> set_threads(unsigned threads) {
  const Loaded& loaded = module();
  if (loaded.table == nullptr) return loaded.error;
  loaded.table->set_threads(threads);
  return {};
}

void request_threads(unsigned threads) {
  const std::lock_guard lock(threads_mutex);
  requested_threads = threads;
  if (ready != nullptr) ready->set_threads(threads);
}

util::Result<void> write_exr(const std::string& path, const ImageView& image) {
  const Loaded& loaded = module();
  if (loaded.table == nullptr) return loaded.error;
  return write_atomically(
      path, [&](const std::string& file) { return loaded.table->write_exr(file, image); });
}

util::Result<void> write_integer(const std::string& path, const ImageView& image, Encoding encoding,
                                 double scale) {
  const Loaded& loaded = module();
  if (loaded.table == nullptr) return loaded.error;
  return write_atomically(path, [&](const std::string& file) {
    return loaded.table->write_integer(file, image, encoding, scale);
  });
}

util::Result<Image> read(const std::string& path, const util::Limits& limits) {
  const Loaded& loaded = module();
  if (loaded.table == nullptr) return loaded.error;
  return loaded.table->read(path, limits);
}

util::Result<Rgba8> decode(std::span<const std::uint8_t> bytes, const std::string& mime,
                           const util::Limits& limits) {
  const Loaded& loaded = module();
  if (loaded.table == nullptr) return loaded.error;
  return loaded.table->decode(bytes, mime, limits);
}

}  // namespace octrace::image
