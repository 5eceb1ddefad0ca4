// scatter doctor --fix, whole: the program at a terminal, what it asks, runs and says, and the second look.
// PROVES: docs/usb.md "When it does not work: doctor".
//
// No command reaches this computer: PATH holds nothing but recorders, and the one that writes does so below
// the mocked root. What this computer itself lacks (its udev rule) may be offered, too, and is recorded only.
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "host_sdk/device/usb/udev_rule.h"
#include "tests/unit/device_usb_diagnosis/made_up_system.h"
#include "tests/usb/person.h"
#include "tests/usb/rig.h"

using namespace scatter;
using namespace scatter::usb_test;
using nlohmann::json;

namespace {

namespace fs = std::filesystem;

const std::string kQuestion = "Run this command? (y/N) ";
const std::string kMemory = "/sys/module/usbcore/parameters/usbfs_memory_mb";

std::string contents(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The commands that remedies are made of, for as long as the object lives: they write down how they were
/// called.
class Recorders {
 public:
  Recorders() : path_(std::getenv("PATH")) {
    std::string name = (fs::temp_directory_path() / "scatter-repairs-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    for (const char* command : {"modprobe", "setfacl", "dfu-util"}) {
      does(command, "");
    }
    does("sudo", "exec \"$@\"");
    // What udev does with the rule: whoever is there may use the instrument.
    does("udevadm",
         "[ \"$1\" = control ] || /bin/chmod 0666 \"$UMOCKDEV_DIR\"/dev/bus/usb/*/002 "
         "\"$UMOCKDEV_DIR\"/dev/hidraw*");
    // The kernel's tables are the mocked ones; of the rest only what would have been written is kept.
    does("tee", "case \"$1\" in /sys/*) exec /bin/cat > \"$UMOCKDEV_DIR$1\";; *) exec /bin/cat > '" +
                    (folder_ / "written").string() + "';; esac");
    ::setenv("PATH", folder_.c_str(), 1);
  }
  ~Recorders() {
    ::setenv("PATH", path_.c_str(), 1);
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  Recorders(const Recorders&) = delete;
  Recorders& operator=(const Recorders&) = delete;

  /// From now on the command also does this, in the shell.
  void does(const std::string& command, const std::string& text) const {
    std::ofstream(folder_ / command) << "#!/bin/sh\necho \"${0##*/} $*\" >> '" << (folder_ / "log").string()
                                     << "'\n"
                                     << text << "\n";
    fs::permissions(folder_ / command, fs::perms::owner_all);
  }
  /// How they were called so far, in order; sudo's own lines left out: root's commands have none.
  [[nodiscard]] std::vector<std::string> calls() const {
    std::ifstream log(folder_ / "log");
    std::vector<std::string> lines;
    for (std::string line; std::getline(log, line);) {
      if (!line.starts_with("sudo ")) {
        lines.push_back(line);
      }
    }
    return lines;
  }
  [[nodiscard]] std::string written() const { return contents(folder_ / "written"); }
  [[nodiscard]] fs::path folder() const { return folder_; }

 private:
  std::string path_;
  fs::path folder_;
};

std::vector<std::string> doctor(std::vector<std::string> options = {}) {
  options.insert(options.begin(), {SCATTER_BINARY, "doctor", "--json"});
  return options;
}

json told(const Ended& ended) {
  INFO(ended.said);
  INFO(ended.out);
  REQUIRE((ended.status == 0 || ended.status == 1));
  json answer = json::parse(ended.out);
  CHECK(ended.status == (answer["problems"] > 0 ? 1 : 0));
  return answer;
}

json look() {
  return told(Person(doctor(), true).ends());
}

json the(const json& answer, const std::string& check) {
  const auto found =
      std::ranges::find_if(answer["findings"], [&](const json& each) { return each["check"] == check; });
  REQUIRE(found != answer["findings"].end());
  return *found;
}

/// What --fix shall offer: the harmless commands in the order of the findings, each once.
std::vector<std::string> offers(const json& answer) {
  std::vector<std::string> commands;
  for (const json& each : answer["findings"]) {
    const bool wrong = each["verdict"] == "PROBLEM" || each["verdict"] == "warning";
    if (wrong && each["harmless"] == true && each["command"] != "" &&
        std::ranges::count(commands, each["command"].get<std::string>()) == 0) {
      commands.push_back(each["command"]);
    }
  }
  return commands;
}

/// Too little transfer memory and nodes that are closed, for the time of a test. (1 MB is less than the 64
/// transfers of an instrument take.)
class Ills {
 public:
  Ills() {
    bus_.set_memory(1'000'000);
    bus_.set_access(false);
  }
  ~Ills() {
    bus_.set_memory(16'000'000);
    bus_.set_access(true);
  }
  Ills(const Ills&) = delete;
  Ills& operator=(const Ills&) = delete;
  BusControl& bus() { return bus_; }

 private:
  BusControl bus_;
};

}  // namespace

TEST_CASE("Each harmless command is shown, asked for, run on yes, and the findings are those of afterwards") {
  const Recorders recorders;
  Ills ills;
  const json before = look();
  REQUIRE(the(before, "usbfs memory")["verdict"] == "PROBLEM");
  REQUIRE(the(before, "permissions")["verdict"] == "PROBLEM");
  const std::vector<std::string> expected = offers(before);
  REQUIRE(expected.size() >= 2);
  CHECK(recorders.calls().empty());

  Person person(doctor({"--fix"}));
  for (const std::string& command : expected) {
    REQUIRE(person.sees("  " + command + "\r\n" + kQuestion));
    person.types("y\n");
    CHECK(person.sees("  done\r\n"));
  }
  const json after = told(person.ends());
  CHECK(the(after, "usbfs memory")["verdict"] == "ok");
  CHECK(the(after, "usbfs memory")["found"].get<std::string>().starts_with("64 MB"));
  CHECK(the(after, "permissions")["verdict"] == "ok");
  // The instrument that could not be asked is asked now.
  CHECK(the(after, "protocol")["verdict"] == "ok");
  CHECK(after["problems"] == before["problems"].get<int>() - 2);
  REQUIRE(after["repairs"].size() == expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CHECK(after["repairs"][k] == json({{"command", expected[k]}, {"outcome", "done"}, {"exit_status", 0}}));
  }
  const auto calls = recorders.calls();
  CHECK(std::ranges::count(calls, "tee " + kMemory) == 1);
  CHECK(std::ranges::count(calls, "udevadm control --reload") == 1);
}

TEST_CASE("no, Enter alone and the end of input run nothing, and the problems are told as they are") {
  const Recorders recorders;
  const Ills ills;
  const json before = look();
  const std::vector<std::string> expected = offers(before);
  for (const char* answer : {"n\n", "\n", "\x04", "no\n"}) {
    INFO("answer " << answer);
    Person person(doctor({"--fix"}));
    for (std::size_t k = 0; k < expected.size(); ++k) {
      REQUIRE(person.sees(kQuestion));
      person.types(answer);
      CHECK(person.sees("  declined\r\n"));
    }
    const json after = told(person.ends());
    CHECK(after["findings"] == before["findings"]);
    CHECK(after["problems"] > 0);
    REQUIRE(after["repairs"].size() == expected.size());
    for (const json& repair : after["repairs"]) {
      CHECK(repair["outcome"] == "declined");
    }
  }
  CHECK(recorders.calls().empty());
}

TEST_CASE("One no among the answers leaves out that command only") {
  const Recorders recorders;
  const Ills ills;
  Person person(doctor({"--fix"}));
  for (const std::string& command : offers(look())) {
    REQUIRE(person.sees(command + "\r\n" + kQuestion));
    person.types(command.find(kMemory) != std::string::npos ? "yes\n" : "n\n");
  }
  const json after = told(person.ends());
  CHECK(the(after, "usbfs memory")["verdict"] == "ok");
  CHECK(the(after, "permissions")["verdict"] == "PROBLEM");
  CHECK(recorders.calls() == std::vector<std::string>{"tee " + kMemory});
}

TEST_CASE("Without a terminal nothing runs and the way out is named; --yes runs all without a question") {
  const Recorders recorders;
  const Ills ills;
  const std::vector<std::string> expected = offers(look());
  const Ended idle = Person(doctor({"--fix"}), true).ends();
  const json unchanged = told(idle);
  CHECK(recorders.calls().empty());
  CHECK(idle.said.find(kQuestion) == std::string::npos);
  CHECK(idle.said.find("--yes") != std::string::npos);
  CHECK(idle.status == 1);
  REQUIRE(unchanged["repairs"].size() == expected.size());
  CHECK(unchanged["repairs"][0]["outcome"] == "not run: nobody to ask");

  const Ended ended = Person(doctor({"--fix", "--yes"}), true).ends();
  const json mended = told(ended);
  CHECK(ended.said.find(kQuestion) == std::string::npos);
  for (const std::string& command : expected) {
    CHECK(ended.said.find(command) != std::string::npos);
  }
  CHECK(the(mended, "usbfs memory")["verdict"] == "ok");
  CHECK(the(mended, "permissions")["verdict"] == "ok");
}

TEST_CASE(
    "A command that fails is told with its status; the others run, and the exit status says what is left") {
  const Recorders recorders;
  const Ills ills;
  recorders.does("udevadm", "exit 5");
  const Ended ended = Person(doctor({"--fix", "--yes"}), true).ends();
  const json after = told(ended);
  CHECK(ended.status == 1);
  CHECK(ended.said.find("failed with status 5") != std::string::npos);
  CHECK(the(after, "usbfs memory")["verdict"] == "ok");
  CHECK(the(after, "permissions")["verdict"] == "PROBLEM");
  const auto& repairs = after["repairs"];
  CHECK(std::ranges::count_if(repairs, [](const json& each) {
          return each["outcome"] == "failed" && each["exit_status"] == 5;
        }) == 1);
}

TEST_CASE("A command that somebody may regret is printed and never run, not even with --yes") {
  const Recorders recorders;
  BusControl bus;
  const int slot = bus.add_of_other_wire(2, true, "seed=5");
  bus.plug(slot);
  const Ended ended = Person(doctor({"--fix", "--yes"}), true).ends();
  const json answer = told(ended);
  CHECK(ended.status == 1);
  const auto wrong = std::ranges::find_if(answer["findings"], [](const json& each) {
    return each["command"].get<std::string>().starts_with("dfu-util");
  });
  REQUIRE(wrong != answer["findings"].end());
  CHECK((*wrong)["harmless"] == false);
  for (const std::string& call : recorders.calls()) {
    CHECK_FALSE(call.starts_with("dfu-util"));
  }
  bus.unplug(slot);
}

TEST_CASE("ctrl-C at the question, and under a command, ends doctor within a second") {
  const Recorders recorders;
  const Ills ills;
  Person asked(doctor({"--fix"}));
  REQUIRE(asked.sees(kQuestion));
  asked.types("\x03");
  Ended ended = asked.ends(std::chrono::seconds(1));
  CHECK(ended.status == 1);
  CHECK(json::parse(ended.out)["error"]["code"] == "ABORTED");
  CHECK(recorders.calls().empty());

  for (const char* command : {"tee", "udevadm"}) {
    recorders.does(command, "exec /bin/sleep 60");
  }
  Person busy(doctor({"--fix"}));
  REQUIRE(busy.sees(kQuestion));
  busy.types("y\n");
  REQUIRE(soon([&] { return !recorders.calls().empty(); }));
  busy.types("\x03");
  ended = busy.ends(std::chrono::seconds(1));
  INFO(ended.said);
  CHECK(ended.status == 1);
  CHECK(json::parse(ended.out)["error"]["code"] == "ABORTED");
}

TEST_CASE("The command for the udev rule, run as it is printed, writes the rule to the byte and applies it") {
  const Recorders recorders;
  // The program may lie anywhere, in a folder that the shell would take for two words, too.
  const fs::path program = recorders.folder() / "it's here" / "scatter";
  fs::create_directory(program.parent_path());
  fs::copy_file(SCATTER_BINARY, program);
  MadeUpSystem system;
  system.plug_in({});
  system.remove("usr/lib/udev/rules.d");
  const Ended ended =
      Person({program.string(), "doctor", "--json", "--root", system.path().string()}, true).ends();
  const std::string command = the(told(ended), "udev rule")["command"];
  const Ended run = Person({"/bin/sh", "-c", command}, true).ends();
  INFO(command << "\n" << run.said);
  CHECK(run.status == 0);
  CHECK(recorders.written() == device::usb::udev_rule());
  CHECK(recorders.calls() ==
        std::vector<std::string>{"tee /etc/udev/rules.d/60-openscatter.rules", "udevadm control --reload",
                                 "udevadm trigger --subsystem-match=usb --subsystem-match=hidraw"});
}
