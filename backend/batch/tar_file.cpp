#include "backend/batch/tar_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <numeric>

namespace octrace::batch {

namespace {

using util::Result;

constexpr std::size_t kBlock = 512;
constexpr std::size_t kLongestName = 100;
constexpr std::uint64_t kLargest = 077777777777;  // 8 GiB less one byte

util::Error io_error(const std::string& file, int error_number) {
  return {util::Exit::io, "IO_ERROR",
          fmt::format("cannot be written: {}", std::strerror(error_number)), file, ""};
}

// "LENGTH path=NAME\n", where LENGTH counts its own digits.
std::string pax_record(std::string_view name) {
  const std::size_t rest = name.size() + std::string_view(" path=\n").size();
  std::size_t length = rest + 1;
  while (std::to_string(length).size() + rest != length) ++length;
  return fmt::format("{} path={}\n", length, name);
}

std::array<char, kBlock> header(std::string_view name, char type, std::uint64_t bytes) {
  std::array<char, kBlock> block{};
  const auto put = [&](std::size_t at, std::string_view text) {
    std::memcpy(block.data() + at, text.data(), text.size());
  };
  put(0, name.substr(0, kLongestName));
  put(100, "0000644");                      // mode
  put(108, "0000000");                      // owner
  put(116, "0000000");                      // group
  put(124, fmt::format("{:011o}", bytes));  // size
  put(136, "00000000000");                  // time
  put(148, "        ");                     // its checksum counts as blanks
  block[156] = type;
  put(257, std::string_view("ustar\0"
                            "00",
                            8));
  const unsigned sum = std::accumulate(block.begin(), block.end(), 0u, [](unsigned total, char c) {
    return total + static_cast<unsigned char>(c);
  });
  put(148, fmt::format("{:06o}", sum));
  block[154] = '\0';
  return block;
}

}  // namespace

Result<TarFile> TarFile::create(const std::string& target) {
  auto file = util::AtomicFile::create(target);
  if (!file) return file.error();
  const int descriptor = ::open(file->temporary().c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0) return io_error(target, errno);
  return TarFile(std::move(*file), descriptor, target);
}

TarFile::TarFile(TarFile&& other) noexcept
    : file_(std::move(other.file_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      target_(std::move(other.target_)),
      bytes_(other.bytes_) {}

TarFile::~TarFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<void> TarFile::write(std::string_view bytes) {
  bytes_ += bytes.size();
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return io_error(target_, written < 0 ? errno : ENOSPC);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return {};
}

Result<void> TarFile::add_entry(std::string_view name, char type, std::string_view content) {
  const auto block = header(name, type, content.size());
  if (auto ok = write({block.data(), block.size()}); !ok) return ok;
  if (auto ok = write(content); !ok) return ok;
  const std::string padding((kBlock - content.size() % kBlock) % kBlock, '\0');
  return write(padding);
}

Result<void> TarFile::add(const std::string& name, std::string_view content) {
  if (content.size() > kLargest) {
    return util::Error{util::Exit::limit, "",
                       fmt::format("{} bytes, a tar holds files of {}", content.size(), kLargest),
                       target_, ""};
  }
  if (name.size() > kLongestName) {
    if (auto ok = add_entry("pax", 'x', pax_record(name)); !ok) return ok;
  }
  return add_entry(name, '0', content);
}

Result<std::uint64_t> TarFile::commit() {
  const std::string end(2 * kBlock, '\0');
  if (auto ok = write(end); !ok) return ok.error();
  if (::close(std::exchange(descriptor_, -1)) != 0) return io_error(target_, errno);
  if (auto ok = file_.commit(); !ok) return ok.error();
  return bytes_;
}

}  // namespace octrace::batch
