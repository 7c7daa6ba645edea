// A run's account as every command and the monitor give it.
#pragma once

#include <nlohmann/json.hpp>

#include "idl/codec.hpp"

namespace cosegraph {

inline nlohmann::ordered_json account_json(const idl::Account& account) {
  return {{"admitted", account.admitted},
          {"labelled", account.labelled},
          {"consumed", account.consumed},
          {"failed", account.failed},
          {"dropped", account.dropped}};
}

}  // namespace cosegraph
