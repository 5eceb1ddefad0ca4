// Any order of calls from both sides of the virtual USB socket. The bytes are the calls.
//
// Every transfer completes exactly once. To the host: the bytes of the device in order, none lost but by
// babble; a transfer that is not full ends where the device ended one, and none goes beyond such an end. To
// the device: the host's bytes in order, as many of a cancelled transfer as it says. A control answer belongs
// to its request.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <set>
#include <span>
#include <vector>

#include "simulator/usb/virtual_usb_controller.h"
#include "tests/fuzz/input.h"
#include "tests/fuzz/require.h"

namespace {

using namespace scatter;
using fuzz::Input;
using fuzz::require;
using simulator::UsbCompletion;
using simulator::UsbOutcome;
using Bytes = std::vector<std::byte>;
using Kind = firmware::UsbEvent::Kind;

constexpr std::uint8_t kIn = 0x81;
constexpr std::uint8_t kOut = 0x02;
constexpr std::size_t kPacket = 64;

struct StillClock final : firmware::Clock {
  std::uint64_t now_us() noexcept override { return 0; }
};

class Socket {
 public:
  Socket() : socket_(clock_, {}, 1) {}

  void call(Input& input) {
    switch (input.byte() % 16) {
      case 0:
        socket_.plug(simulator::UsbBusSpeed::kHigh);
        begin();
        break;
      case 1:
        socket_.unplug();
        begin();
        break;
      case 2:
        socket_.reset();
        begin();
        break;
      case 3:
        socket_.connect(input.byte() % 4 != 0);
        take_all();
        if (!socket_.present()) {
          begin();
        }
        break;
      case 4:
        open();
        break;
      case 5:
      case 6:
        write(input.word() % 2000);
        break;
      case 7:
        end_transfer();
        break;
      case 8:
      case 9:
        submit_in(input.byte() % 8 == 0 ? input.word() % 1000 : kPacket * (1 + input.byte() % 16));
        break;
      case 10:
        submit_out(input.word() % 3000);
        break;
      case 11:
        read(input.word() % 3000);
        break;
      case 12:
        cancel(input.byte());
        break;
      case 13:
        submit_control();
        break;
      case 14:
        take_event(input.byte());
        break;
      default:
        answer(input.byte());
        break;
    }
    take_all();
    check();
  }

 private:
  struct Transfer {
    std::uint8_t endpoint = 0;
    std::size_t length = 0;
    std::uint8_t tag = 0;
  };
  struct Given {
    std::uint64_t id = 0;
    Bytes data;
    std::size_t actual = 0;  ///< Of those that are complete.
    bool complete = false;
  };

  /// Both pipes are new.
  void begin() {
    take_all();
    sent_.clear();
    ends_.clear();
    got_ = begun_ = 0;
    strict_ = true;
    given_.clear();
    read_.clear();
  }
  void open() {
    if (!socket_.present()) {
      return;  // A driver opens nothing while it is off the bus.
    }
    using Type = firmware::UsbEndpoint::Type;
    const std::array<firmware::UsbEndpoint, 2> endpoints{{
        {.address = kIn, .type = Type::kBulk, .packet_bytes = kPacket},
        {.address = kOut, .type = Type::kBulk, .packet_bytes = kPacket},
    }};
    // A transfer that waits here goes on with what comes next, so its place in the old bytes is gone.
    socket_.open_endpoints({});
    take_all();
    socket_.open_endpoints(endpoints);
    open_ = true;
    begin();
  }
  void write(std::size_t size) {
    Bytes bytes(size);
    for (std::byte& byte : bytes) {
      byte = static_cast<std::byte>(next_byte_++ % 251);
    }
    const std::size_t taken = socket_.write(kIn, bytes);
    require(taken <= size);
    sent_.insert(sent_.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(taken));
  }
  void end_transfer() {
    socket_.end_transfer(kIn);
    if (sent_.size() > begun_) {
      ends_.insert({sent_.size(), (sent_.size() - begun_) % kPacket == 0});
      begun_ = sent_.size();
    }
  }
  void submit_in(std::size_t length) {
    under_way_.insert({++id_, {.endpoint = kIn, .length = length}});
    socket_.submit({.id = id_, .endpoint = kIn, .length = length});
  }
  void submit_out(std::size_t size) {
    Bytes bytes(size);
    for (std::byte& byte : bytes) {
      byte = static_cast<std::byte>(next_byte_++ % 251);
    }
    under_way_.insert({++id_, {.endpoint = kOut, .length = size}});
    given_.push_back({.id = id_, .data = bytes});
    socket_.submit({.id = id_, .endpoint = kOut, .data = std::move(bytes)});
  }
  void read(std::size_t most) {
    Bytes bytes(most);
    bytes.resize(socket_.read(kOut, bytes));
    read_.insert(read_.end(), bytes.begin(), bytes.end());
  }
  void cancel(std::uint8_t choice) {
    if (under_way_.empty()) {
      require(!socket_.cancel(id_ + 1));
      return;
    }
    auto one = under_way_.begin();
    std::advance(one, choice % under_way_.size());
    require(socket_.cancel(one->first));
  }
  void submit_control() {
    const auto tag = static_cast<std::uint8_t>(++id_ % 200);
    under_way_.insert({id_, {.endpoint = 0x80, .length = 8, .tag = tag}});
    socket_.submit({.id = id_, .endpoint = 0x80, .setup = {0x80, tag, 0, 0, 0, 0, 8, 0}, .length = 8});
  }
  void take_event(std::uint8_t) {
    const firmware::UsbEvent event = socket_.next_event();
    if (event.kind == Kind::kSetup) {
      seen_tag_ = event.setup[1];
    }
  }
  void answer(std::uint8_t how) {
    if (how % 4 == 0) {
      socket_.control_stall();
    } else if (how % 4 == 1) {
      socket_.control_accept();
    } else {
      const Bytes bytes(1 + how % 12, static_cast<std::byte>(seen_tag_));
      socket_.control_send(bytes);
    }
  }

  void take_all() {
    while (const auto completion = socket_.next_completion()) {
      const auto found = under_way_.find(completion->id);
      require(found != under_way_.end());
      const Transfer transfer = found->second;
      under_way_.erase(found);
      require(completion->actual <= transfer.length);
      require(transfer.endpoint == kOut || completion->data.size() == completion->actual);
      if (transfer.endpoint == kIn) {
        taken_in(*completion, transfer);
      } else if (transfer.endpoint == kOut) {
        const auto given = std::ranges::find(given_, completion->id, &Given::id);
        require(given != given_.end());
        require(completion->outcome != UsbOutcome::kDone || completion->actual == transfer.length);
        given->complete = true;
        given->actual = completion->actual;
      } else {
        require(std::ranges::all_of(completion->data,
                                    [&](std::byte byte) { return byte == std::byte{transfer.tag}; }));
      }
    }
    require(under_way_.size() == socket_.under_way());
  }
  void taken_in(const UsbCompletion& completion, const Transfer& transfer) {
    if (completion.outcome == UsbOutcome::kBabble) {
      require(transfer.length % kPacket != 0);
      strict_ = false;
    }
    if (!strict_ ||
        (completion.outcome != UsbOutcome::kDone && completion.outcome != UsbOutcome::kCancelled)) {
      return;
    }
    require(got_ + completion.actual <= sent_.size());
    require(std::equal(completion.data.begin(), completion.data.end(),
                       sent_.begin() + static_cast<std::ptrdiff_t>(got_)));
    // Nothing before the last byte of it may be an end.
    const auto inner = ends_.upper_bound(got_);
    const std::size_t from = got_;
    got_ += completion.actual;
    require(completion.actual == 0 || inner == ends_.end() || inner->first >= got_);
    if (completion.outcome == UsbOutcome::kDone && completion.actual < transfer.length) {
      require(ends_.contains(got_));
      require(completion.actual > 0 || ends_.at(from));  // No bytes: only behind a full packet.
    }
  }
  void check() {
    if (strict_ && open_ && socket_.present()) {
      require(socket_.waiting(kIn) == 0 || socket_.waiting(kIn) == sent_.size() - got_);
    }
    Bytes expected;
    for (const Given& each : given_) {
      const auto count = static_cast<std::ptrdiff_t>(each.complete ? each.actual : each.data.size());
      expected.insert(expected.end(), each.data.begin(), each.data.begin() + count);
    }
    require(read_.size() <= expected.size() && std::equal(read_.begin(), read_.end(), expected.begin()));
  }

  StillClock clock_;
  simulator::VirtualUsbController socket_;
  std::uint64_t id_ = 0;
  std::size_t next_byte_ = 0;
  bool open_ = false;
  std::uint8_t seen_tag_ = 0;
  std::map<std::uint64_t, Transfer> under_way_;
  Bytes sent_;                        ///< By the device, since the pipes were new.
  std::map<std::size_t, bool> ends_;  ///< Where its transfers end; true: behind a full packet.
  std::size_t got_ = 0;               ///< By the host.
  std::size_t begun_ = 0;             ///< Where the device's transfer under way began.
  bool strict_ = true;                ///< False behind a babble, which loses bytes.
  std::deque<Given> given_;
  Bytes read_;
};

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming): libFuzzer's name.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, std::min<std::size_t>(size, 2000));
  Socket socket;
  while (!input.empty()) {
    socket.call(input);
  }
  return 0;
}
