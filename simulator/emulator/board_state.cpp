#include "simulator/emulator/board_state.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "firmware/backplane/shared_memory.h"
#include "firmware/core/factory_set.h"
#include "firmware/image/marks.h"
#include "host_sdk/firmware_files/package.h"
#include "simulator/emulator/qemu_process.h"
#include "simulator/instrument/virtual_board.h"

namespace scatter::simulator {

namespace backplane = firmware::backplane;

namespace {

constexpr std::byte kErased{0xFF};

std::unexpected<Error> system_failure(const std::filesystem::path& file, std::string_view step) {
  const int number = errno;
  const ErrorCode code = number == EACCES || number == EPERM || number == EROFS ? ErrorCode::kPermissionDenied
                         : number == ENOENT || number == ENOTDIR                ? ErrorCode::kNotFound
                                                                                : ErrorCode::kUnavailable;
  return fail(code, fmt::format("{}: {}: {}", file.string(), step, std::strerror(number)),
              "name a folder that you may write to and that has 20 MB of room");
}

/// Opens or makes a file of `size` erased bytes; `made` tells which.
Result<FileDescriptor> open_sized(const std::filesystem::path& file, std::size_t size, bool& made) {
  FileDescriptor opened(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  struct stat info{};
  if (!opened.open() || ::fstat(opened.number(), &info) != 0) {
    return system_failure(file, "open");
  }
  made = info.st_size == 0;
  if (!made) {
    if (static_cast<std::size_t>(info.st_size) != size) {
      return fail(ErrorCode::kDataLoss,
                  fmt::format("{}: has {} bytes, expected {}", file.string(), info.st_size, size),
                  "name the folder of an emulated board, or an empty one");
    }
    return opened;
  }
  const std::vector<std::byte> erased(1U << 16U, kErased);
  for (std::size_t at = 0; at < size;) {
    const ssize_t count = ::write(opened.number(), erased.data(), std::min(erased.size(), size - at));
    if (count < 0 && errno != EINTR) {
      auto failure = system_failure(file, "write");
      ::unlink(file.c_str());
      return failure;
    }
    at += static_cast<std::size_t>(std::max<ssize_t>(count, 0));
  }
  return opened;
}

/// A region of the shared memory as the flash that it stands for.
class MappedFlash final : public firmware::Flash {
 public:
  explicit MappedFlash(std::span<std::byte> cells) : cells_(cells) {}
  [[nodiscard]] Geometry geometry() noexcept override {
    return {.unit_bytes = backplane::kSlotUnitBytes,
            .units = static_cast<std::uint32_t>(cells_.size() / backplane::kSlotUnitBytes),
            .program_bytes = backplane::kSlotGranuleBytes};
  }
  [[nodiscard]] bool read(std::uint32_t offset, std::span<std::byte> out) noexcept override {
    if (!inside(offset, out.size())) {
      return false;
    }
    std::ranges::copy(cells_.subspan(offset, out.size()), out.begin());
    return true;
  }
  [[nodiscard]] bool program(std::uint32_t offset, std::span<const std::byte> bytes) noexcept override {
    if (!inside(offset, bytes.size()) || offset % backplane::kSlotGranuleBytes != 0 ||
        bytes.size() % backplane::kSlotGranuleBytes != 0 ||
        std::ranges::any_of(cells_.subspan(offset, bytes.size()), [](std::byte b) { return b != kErased; })) {
      return false;
    }
    std::ranges::copy(bytes, cells_.begin() + offset);
    return true;
  }
  [[nodiscard]] bool erase(std::uint32_t unit) noexcept override {
    if (unit >= geometry().units) {
      return false;
    }
    std::ranges::fill(
        cells_.subspan(std::size_t{unit} * backplane::kSlotUnitBytes, backplane::kSlotUnitBytes), kErased);
    return true;
  }

 private:
  [[nodiscard]] bool inside(std::uint32_t offset, std::size_t size) const noexcept {
    return offset <= cells_.size() && size <= cells_.size() - offset;
  }
  std::span<std::byte> cells_;
};

}  // namespace

Result<BoardState> BoardState::open(const std::filesystem::path& folder) {
  BoardState state;
  if (folder.empty()) {
    std::error_code problem;
    std::string name = (std::filesystem::temp_directory_path(problem) / "scatter-board-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      return system_failure(name, "make a temporary folder");
    }
    state.folder_ = name;
    state.temporary_ = true;
  } else {
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    // QEMU has the same working folder, yet a path that does not depend on it is safer.
    state.folder_ = std::filesystem::absolute(folder);
  }
  bool eeprom_made = false;
  auto file = open_sized(state.shared_memory_file(), backplane::kSharedMemoryBytes, state.fresh_);
  if (!file) {
    return std::unexpected(std::move(file.error()));
  }
  state.file_ = std::move(*file);
  if (::flock(state.file_.number(), LOCK_EX | LOCK_NB) != 0) {
    return fail(ErrorCode::kBusy,
                fmt::format("{}: another emulated board runs on it", state.folder_.string()),
                "stop the other one, or name another folder");
  }
  if (const auto eeprom = open_sized(state.eeprom_file(), QemuProcess::kEepromBytes, eeprom_made); !eeprom) {
    return std::unexpected(eeprom.error());
  }
  void* mapped = ::mmap(nullptr, backplane::kSharedMemoryBytes, PROT_READ | PROT_WRITE, MAP_SHARED,
                        state.file_.number(), 0);
  if (mapped == MAP_FAILED) {
    return system_failure(state.shared_memory_file(), "map");
  }
  state.memory_ = static_cast<std::byte*>(mapped);
  state.bytes_ = backplane::kSharedMemoryBytes;
  return state;
}

BoardState::BoardState(BoardState&& other) noexcept
    : folder_(std::move(other.folder_)),
      temporary_(std::exchange(other.temporary_, false)),
      fresh_(other.fresh_),
      file_(std::move(other.file_)),
      memory_(std::exchange(other.memory_, nullptr)),
      bytes_(std::exchange(other.bytes_, 0)) {}

BoardState::~BoardState() {
  if (memory_ != nullptr) {
    ::munmap(memory_, bytes_);
  }
  let_go();
}

std::filesystem::path BoardState::shared_memory_file() const {
  return folder_ / "memory.bin";
}
std::filesystem::path BoardState::eeprom_file() const {
  return folder_ / "eeprom.bin";
}

void BoardState::let_go() noexcept {
  if (temporary_) {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
    temporary_ = false;
  }
}

Status provide_factory_set(BoardState& state, VirtualBoard& board) {
  const protocol::Descriptor& descriptor = board.descriptor();
  std::vector<std::byte> encoded(protocol::encoded_size(descriptor));
  (void)protocol::encode(descriptor, std::span(encoded));
  const firmware::FactoryObjects objects{.descriptor = encoded,
                                         .hot_pixels = board.bench().object(protocol::ObjectId::kHotPixels),
                                         .prnu_map = board.bench().object(protocol::ObjectId::kPrnuMap)};
  std::vector<std::byte> set(firmware::factory_set_bytes(objects));
  const auto place = state.shared_memory().subspan(backplane::kFactoryOffset, backplane::kFactoryBytes);
  if (set.size() > place.size() || firmware::compose_factory_set(objects, set) != set.size()) {
    return fail(
        ErrorCode::kInternal,
        fmt::format("the factory set has {} bytes, the board has room for {}", set.size(), place.size()),
        "report this with the command that led here");
  }
  if (state.fresh()) {
    std::ranges::copy(set, place.begin());
    return {};
  }
  if (!std::ranges::equal(set, place.first(set.size()))) {
    return fail(ErrorCode::kFailedPrecondition,
                fmt::format("{} is the state of another instrument than {} with these options",
                            state.shared_memory_file().string(), descriptor.serial.str()),
                "give the options that it was made with (--seed, --profile, ...), or another folder");
  }
  return {};
}

Status install_firmware(BoardState& state, const std::filesystem::path& package) {
  const auto loaded = firmware_files::Package::load(package);
  if (!loaded) {
    return std::unexpected(loaded.error());
  }
  const firmware_files::Image& image = loaded->image(0);
  const std::uint32_t address =
      backplane::kSharedMemoryAddress + backplane::kSlotOffset[0] + protocol::kImageBodyOffset;
  if (image.header.load_address != address) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: the image for slot 0 is linked for 0x{:08X}, this board runs it at 0x{:08X}",
                            package.string(), image.header.load_address, address),
                "give an image for mps2_an500 (./run firmware makes one)");
  }
  MappedFlash slot(state.shared_memory().subspan(backplane::kSlotOffset[0], backplane::kSlotBytes));
  constexpr std::size_t kGranule = backplane::kSlotGranuleBytes;
  std::vector<std::byte> body((image.body.size() + kGranule - 1) / kGranule * kGranule, kErased);
  std::ranges::copy(image.body, body.begin());
  const auto header = firmware_files::header_bytes(image.header);
  for (std::uint32_t unit = 0; unit < slot.geometry().units; ++unit) {
    (void)slot.erase(unit);
  }
  const bool fits =
      body.size() <= backplane::kSlotBytes - backplane::kSlotUnitBytes - protocol::kImageBodyOffset;
  if (!fits || !slot.program(0, std::as_bytes(std::span(header))) ||
      !slot.program(protocol::kImageBodyOffset, body) ||
      !firmware::write_mark(slot, firmware::MarkKind::kConfirmed, 1)) {
    return fail(ErrorCode::kInvalidArgument,
                fmt::format("{}: the image of {} bytes does not fit into a slot of {}", package.string(),
                            image.body.size(), backplane::kSlotBytes),
                "give an image for mps2_an500 (./run firmware makes one)");
  }
  return {};
}

}  // namespace scatter::simulator
