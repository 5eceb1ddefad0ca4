// protocol_spec_tables FILE: rewrites the tables of protocol/SPEC.md from the code.
#include <fstream>
#include <iostream>
#include <iterator>

#include "tests/unit/protocol/spec_tables.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: protocol_spec_tables protocol/SPEC.md\n";
    return 2;
  }
  std::ifstream in(argv[1]);
  const std::string before{std::istreambuf_iterator<char>(in), {}};
  if (!in || before.empty()) {
    std::cerr << argv[1] << ": cannot be read\n";
    return 1;
  }
  in.close();
  std::ofstream out(argv[1]);
  out << scatter::protocol::test::with_fresh_tables(before);
  out.close();
  if (!out) {
    std::cerr << argv[1] << ": cannot be written\n";
    return 1;
  }
  return 0;
}
