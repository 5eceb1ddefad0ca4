// scatter flash, scatter firmware and what scatter info says of slots, as a user runs them.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/unit/tools/command.h"

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

const std::string kTestKey = "firmware/keys/test.key";
const std::string kProduct = "OpenScatter HS-1 (simulated)";

/// A binary as a linker makes it: stack, reset vector, code.
std::string linked_for(std::uint32_t address, std::size_t size) {
  std::string out;
  for (const std::uint32_t word : {0x2001'0000U, address + 9}) {
    for (unsigned shift = 0; shift < 32; shift += 8) {
      out += static_cast<char>(word >> shift & 0xFFU);
    }
  }
  while (out.size() < size) {
    out += static_cast<char>(out.size() * 31);
  }
  return out;
}

void write_text(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

struct Making {
  std::string version = "2.0.0";
  std::string counter = "1";
  std::string key = kTestKey;
  std::string product = kProduct;
  std::size_t bytes = 20'000;
};

/// Signs a release into `name`.scfw and `name`.dfu, as a maker does.
std::string make_firmware(const Scratch& scratch, const std::string& name, const Making& making = {}) {
  const fs::path slot0 = scratch / (name + "0.bin");
  const fs::path slot1 = scratch / (name + "1.bin");
  const fs::path out = scratch / (name + ".scfw");
  write_text(slot0, linked_for(0x6080'0400, making.bytes));
  write_text(slot1, linked_for(0x6088'0400, making.bytes));
  const Finished made = scatter({"firmware",   "sign",
                                 "--key",      making.key,
                                 "--product",  making.product,
                                 "--version",  making.version,
                                 "--counter",  making.counter,
                                 "--slot0",    slot0.string(),
                                 "--slot1",    slot1.string(),
                                 "--address0", "0x60800400",
                                 "--address1", "0x60880400",
                                 "-o",         out.string(),
                                 "--dfu",      (scratch / (name + ".dfu")).string()});
  CAPTURE(made.err);
  REQUIRE(made.status == 0);
  return out.string();
}

/// An instrument that remembers its flash.
std::string instrument(const Scratch& scratch) {
  return "sim:?flash=" + (scratch / "flash.bin").string();
}

Json info(const std::string& uri) {
  const Finished told = scatter({"info", uri, "--json"});
  CAPTURE(told.err);
  REQUIRE(told.status == 0);
  return Json::parse(told.out);
}

void check_refused(const std::string& uri, const std::vector<std::string>& arguments,
                   const std::string& says) {
  std::vector<std::string> words = {"flash", uri};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const Finished refused = scatter(words);
  CAPTURE(refused.out, refused.err);
  CHECK(refused.status == 1);
  CHECK_THAT(refused.err, Catch::Contains(says) && Catch::Contains("remedy: "));
}

}  // namespace

TEST_CASE("A maker's own key signs firmware that only those who trust the key accept") {
  const Scratch scratch;
  const std::string name = (scratch / "maker").string();
  const Finished made = scatter({"firmware", "keygen", "-o", name, "--json"});
  REQUIRE(made.status == 0);
  const std::string id = Json::parse(made.out)["key"];
  CHECK(scatter({"firmware", "keygen", "-o", name}).status == 1);  // Never over an old key.
  const std::string image = make_firmware(scratch, "a", {.key = name + ".key"});
  const Finished good = scatter({"firmware", "verify", image, "--key", name + ".pub", "--json"});
  REQUIRE(good.status == 0);
  const Json said = Json::parse(good.out);
  CHECK(said["verified"] == true);
  CHECK(said["key"] == id);
  CHECK(said["test_key"] == false);
  CHECK(said["version"] == "2.0.0");
  CHECK(said["images"][1]["address"] == "0x60880400");
  const Finished stranger = scatter({"firmware", "verify", image});
  CHECK(stranger.status == 1);
  CHECK_THAT(stranger.err,
             Catch::Contains(id) && Catch::Contains("without --key only the test key is known"));
  check_refused(instrument(scratch), {image}, "signed with key " + id);
  // The host is told to trust it, the instrument is not.
  check_refused(instrument(scratch), {image, "--key", name + ".pub"},
                "not signed by a key that this device trusts");
}

TEST_CASE("What the test key signed is verified, and said to be for tests") {
  const Scratch scratch;
  make_firmware(scratch, "a");
  const Finished verified = scatter({"firmware", "verify", (scratch / "a.dfu").string()});
  CHECK(verified.status == 0);
  CHECK_THAT(verified.out, Catch::Contains("the test key, which everybody has") &&
                               Catch::Contains("release instruments refuse the test key"));
}

TEST_CASE("flash updates an instrument, and info shows both slots") {
  const Scratch scratch;
  const std::string uri = instrument(scratch);
  const std::string image = make_firmware(scratch, "a");
  const Finished flashed = scatter({"flash", uri, image});
  CAPTURE(flashed.err);
  REQUIRE(flashed.status == 0);
  CHECK_THAT(flashed.err, Catch::Contains("0.1.0 runs; 2.0.0 goes into slot 1: 20000 bytes"));
  CHECK_THAT(flashed.out, Catch::Contains("2.0.0 runs in slot 1 and is confirmed; before: 0.1.0"));
  const Json told = info(uri);
  CHECK(told["firmware"] == "openscatter 2.0.0");
  const Json& slots = told["firmware_slots"]["slots"];
  CHECK(slots[0]["version"] == "0.1.0");
  CHECK(slots[0]["running"] == false);
  CHECK(slots[1]["version"] == "2.0.0");
  CHECK(slots[1]["running"] == true);
  CHECK(slots[1]["verdict"] == "confirmed");
  CHECK(told["last_crash"].is_null());
  CHECK(told["reset_reason"] == "power on");
  CHECK(told["rescue_mode"] == false);
  CHECK(told.contains("worst_main_loop_turn_us"));
  const Finished people = scatter({"info", uri});
  CHECK_THAT(people.out, Catch::Contains("slot 1, runs") && Catch::Contains("none since power-on"));
  // It is there; a second time needs --force.
  check_refused(uri, {image}, "version 2.0.0 runs already");
  CHECK(scatter({"flash", uri, image, "--force"}).status == 0);
}

TEST_CASE("flash takes the .dfu file, too, and answers machines in JSON") {
  const Scratch scratch;
  make_firmware(scratch, "a");
  const Finished flashed = scatter({"flash", instrument(scratch), (scratch / "a.dfu").string(), "--json"});
  REQUIRE(flashed.status == 0);
  const Json said = Json::parse(flashed.out);
  CHECK(said["outcome"] == "confirmed");
  CHECK(said["slot"] == 1);
  CHECK(said["sent_bytes"] == 20'000);
  CHECK(said["after"]["slots"][1]["verdict"] == "confirmed");
  CHECK(flashed.err.empty());
}

TEST_CASE("flash refuses what does not belong on the instrument, which stays as it is") {
  const Scratch scratch;
  const std::string uri = instrument(scratch);
  REQUIRE(
      scatter({"flash", uri, make_firmware(scratch, "base", {.version = "2.0.0", .counter = "5"})}).status ==
      0);
  const std::string before = contents(scratch / "flash.bin");
  const std::string good = make_firmware(scratch, "good", {.version = "3.0.0", .counter = "6"});
  const std::string bytes = contents(good);
  const std::string bad = (scratch / "bad.scfw").string();
  std::string says;
  std::string image = bad;
  SECTION("another product") {
    image = make_firmware(scratch, "other", {.counter = "6", .product = "OpenScatter HS-9"});
    says = "for product \"OpenScatter HS-9\", the instrument is a \"OpenScatter HS-1 (simulated)\"";
  }
  SECTION("a step back") {
    image = make_firmware(scratch, "old", {.version = "1.0.0", .counter = "4"});
    says = "security counter is 4, the instrument takes 5 or higher";
  }
  SECTION("truncated") {
    write_text(bad, bytes.substr(0, bytes.size() - 1));
    says = "the file's size is";
  }
  SECTION("a bit flipped in the body") {
    std::string flipped = bytes;
    flipped[20'000] = static_cast<char>(flipped[20'000] ^ 4);
    write_text(bad, flipped);
    says = "the SHA-512 of image 0's body";
  }
  SECTION("a bit flipped in the signature") {
    std::string flipped = bytes;
    flipped[64 + 200] = static_cast<char>(flipped[64 + 200] ^ 4);
    write_text(bad, flipped);
    says = "the signature of image 0 is wrong";
  }
  SECTION("no firmware") {
    write_text(bad, "hello");
    says = "is no firmware file";
  }
  SECTION("no file") {
    says = "No such file";
  }
  check_refused(uri, {image}, says);
  // Every start counts in the flash; the slots behind its first 256 KiB must not change.
  constexpr std::size_t kSlots = 256 * 1024;
  CHECK(contents(scratch / "flash.bin").substr(kSlots) == before.substr(kSlots));
  CHECK(info(uri)["firmware"] == "openscatter 2.0.0");
}

TEST_CASE("flash --no-confirm leaves a trial that the next start ends, over a socket as well") {
  const Scratch scratch;
  const std::string address = "unix:" + (scratch / "s").string();
  const std::string image = make_firmware(scratch, "a");
  Command served({"simulate", "--listen", address});
  while (served.output().empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  const Finished trial = scatter({"flash", address, image, "--no-confirm"});
  CAPTURE(trial.err);
  REQUIRE(trial.status == 0);
  CHECK_THAT(trial.out, Catch::Contains("on trial"));
  CHECK(info(address)["firmware_slots"]["slots"][1]["trial"] == true);
  SECTION("the same command keeps it, without sending it again") {
    const Finished kept = scatter({"flash", address, image, "--json"});
    REQUIRE(kept.status == 0);
    CHECK(Json::parse(kept.out)["sent_bytes"] == 0);
    CHECK(info(address)["firmware_slots"]["slots"][1]["verdict"] == "confirmed");
  }
  SECTION("another firmware ends the trial first") {
    const Finished next = scatter({"flash", address, make_firmware(scratch, "b", {.version = "2.1.0"})});
    REQUIRE(next.status == 0);
    CHECK_THAT(next.out, Catch::Contains("2.1.0 runs in slot 1 and is confirmed; before: 0.1.0"));
  }
  served.signal(SIGINT);
  CHECK(served.wait().status == 0);
}

TEST_CASE("An interrupted flash says how to go on, and does") {
  const Scratch scratch;
  const std::string address = "unix:" + (scratch / "s").string();
  const std::string image = make_firmware(scratch, "a", {.bytes = 500'000});
  Command served({"simulate", "--listen", address});
  while (served.output().empty()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  int interrupted = 0;
  for (int attempt = 0; attempt < 3; ++attempt) {
    Command flash({"flash", address, image});
    std::this_thread::sleep_for(std::chrono::milliseconds(20 + 10 * attempt));
    flash.signal(SIGINT);
    const Finished ended = flash.wait();
    CAPTURE(ended.err);
    // Fast machines may be done before the signal comes.
    if (ended.status == 0) {
      break;
    }
    CHECK((ended.status == 1 || ended.status == 128 + SIGINT));
    if (ended.status == 1 && ended.err.find("runs already") == std::string::npos) {
      CHECK_THAT(ended.err, Catch::Contains("remedy: "));
    }
    ++interrupted;
  }
  CAPTURE(interrupted);
  const Finished last = scatter({"flash", address, image});
  CAPTURE(last.err);
  CHECK((last.status == 0 || last.err.find("runs already") != std::string::npos));
  const Json told = info(address);
  CHECK(told["firmware"] == "openscatter 2.0.0");
  CHECK(told["firmware_slots"]["slots"][1]["verdict"] == "confirmed");
  served.signal(SIGINT);
  CHECK(served.wait().status == 0);
}

TEST_CASE("An instrument without firmware is shown in rescue mode, and flash brings it back") {
  const Scratch scratch;
  const std::string uri = instrument(scratch);
  REQUIRE(info(uri)["rescue_mode"] == false);
  // The produced image's header, first thing in slot 0, wears out.
  std::string cells = contents(scratch / "flash.bin");
  cells[256 * 1024 + 100] = 0;
  write_text(scratch / "flash.bin", cells);
  const Finished told = scatter({"info", uri});
  REQUIRE(told.status == 0);
  CHECK_THAT(told.out, Catch::Contains("rescue mode") && Catch::Contains("scatter flash") &&
                           Catch::Contains("unusable"));
  CHECK(info(uri)["rescue_mode"] == true);
  const Finished measured = scatter({"measure", uri, "-o", (scratch / "out").string()});
  CHECK(measured.status == 1);
  CHECK_THAT(measured.err, Catch::Contains("flash a firmware image"));
  const Finished flashed = scatter({"flash", uri, make_firmware(scratch, "a")});
  CAPTURE(flashed.err);
  CHECK(flashed.status == 0);
  CHECK(info(uri)["firmware"] == "openscatter 2.0.0");
}

TEST_CASE("sign refuses binaries of swapped slots and a public key, and leaves no file") {
  const Scratch scratch;
  make_firmware(scratch, "a");
  const std::string slot0 = (scratch / "a0.bin").string();
  const std::string slot1 = (scratch / "a1.bin").string();
  const fs::path out = scratch / "out.scfw";
  const auto sign = [&](const std::string& key, const std::string& first, const std::string& second) {
    return scatter({"firmware",   "sign",       "--key",      key,         "--product",
                    "p",          "--version",  "v",          "--counter", "1",
                    "--slot0",    first,        "--slot1",    second,      "--address0",
                    "0x60800400", "--address1", "0x60880400", "-o",        out.string()});
  };
  const Finished swapped = sign(kTestKey, slot1, slot0);
  CHECK(swapped.status == 1);
  CHECK_THAT(swapped.err, Catch::Contains("reset vector") && Catch::Contains("swapped"));
  const Finished open = sign("firmware/keys/test.pub", slot0, slot1);
  CHECK(open.status == 1);
  CHECK_THAT(open.err, Catch::Contains(".key"));
  CHECK_FALSE(fs::exists(out));
}
