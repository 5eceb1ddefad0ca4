// OpenEXR streams in memory. Internal to formats: includes OpenEXR.
#pragma once

#include <OpenEXR/ImfIO.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>

namespace scatter::formats {

/// Reads bytes that the caller keeps alive. Throws at the end, as OpenEXR expects.
class ExrMemoryInput final : public Imf::IStream {
 public:
  ExrMemoryInput(std::string_view bytes, const char* name) : IStream(name), bytes_(bytes) {}

  [[nodiscard]] bool isMemoryMapped() const override { return true; }
  char* readMemoryMapped(int n) override {
    need(n);
    // OpenEXR's interface lacks the const; it only reads.
    char* at = const_cast<char*>(bytes_.data()) + at_;
    at_ += static_cast<std::uint64_t>(n);
    return at;
  }
  bool read(char c[], int n) override {
    need(n);
    std::memcpy(c, bytes_.data() + at_, static_cast<std::size_t>(n));
    at_ += static_cast<std::uint64_t>(n);
    return at_ < bytes_.size();
  }
  uint64_t tellg() override { return at_; }
  void seekg(uint64_t pos) override { at_ = pos; }

 private:
  void need(int n) const {
    if (n < 0 || at_ > bytes_.size() || static_cast<std::uint64_t>(n) > bytes_.size() - at_) {
      throw std::runtime_error("the file ends early");
    }
  }
  std::string_view bytes_;
  std::uint64_t at_ = 0;
};

/// Collects what OpenEXR writes, seeks included.
class ExrMemoryOutput final : public Imf::OStream {
 public:
  explicit ExrMemoryOutput(std::size_t expected_size) : OStream("memory") { bytes_.reserve(expected_size); }

  void write(const char c[], int n) override {
    const std::size_t end = at_ + static_cast<std::size_t>(n);
    if (end > bytes_.size()) {
      bytes_.resize(end);
    }
    std::memcpy(bytes_.data() + at_, c, static_cast<std::size_t>(n));
    at_ = end;
  }
  uint64_t tellp() override { return at_; }
  void seekp(uint64_t pos) override { at_ = static_cast<std::size_t>(pos); }

  [[nodiscard]] std::string take() noexcept { return std::move(bytes_); }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

}  // namespace scatter::formats
