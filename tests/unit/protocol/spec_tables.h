// The tables of protocol/SPEC.md, made from the code.
#pragma once

#include <string>

namespace scatter::protocol::test {

/// SPEC.md with the text between each pair of lines "<!-- table NAME -->" and "<!-- end -->" made anew.
/// Tables: header, status, messages, fields, objects. An unknown name gives a table that says so.
std::string with_fresh_tables(const std::string& spec);

}  // namespace scatter::protocol::test
