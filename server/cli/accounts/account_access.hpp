// The accounts of a station, from the command line: asked of the station that runs in the data folder, or changed in
// its database under the folder's lock when none does.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "server/cli/accounts/station_client.hpp"
#include "server/config/data_folder.hpp"
#include "server/identity/account_store.hpp"
#include "server/storage/database/database.hpp"

namespace server::cli {

// Every function throws std::runtime_error with a sentence when it cannot be done.
class AccountAccess {
 public:
  enum class Missing : std::uint8_t { refuse, make };  // what to do when there is no database yet
  AccountAccess(const std::filesystem::path& data_dir, Missing missing);

  nlohmann::json users();
  void add_user(const std::string& name, identity::Role role, const std::string& password);
  void set_role(const std::string& name, identity::Role role);
  void set_password(const std::string& name, const std::string& password);
  void set_disabled(const std::string& name, bool disabled);
  void remove_user(const std::string& name);

  nlohmann::json tokens();
  nlohmann::json add_token(const std::string& name, identity::Scopes scopes, std::int64_t days);  // with its "secret"
  void revoke_token(const std::string& name);
  void revive_token(const std::string& name);

  nlohmann::json enrolments();
  nlohmann::json enrol(const std::string& robot_id);  // with its "secret"
  // How many of its samples were given up; none: the station will do it.
  std::optional<std::uint64_t> revoke_robot(const std::string& robot_id);
  void set_retired(const std::string& robot_id, bool retired);

 private:
  nlohmann::json ask(const std::string& method, const std::string& target, const nlohmann::json& body = nullptr) const;
  // Changes the entry of this name: by POST /api/v1/LIST/NAME/ACT, or by `change` of the store where no station runs.
  template <class Change>
  void act(const std::string& list, const std::string& name, const std::string& act, const nlohmann::json& body,
           const Change& change);
  void change_user(const std::string& name, const identity::UserChange& change, const nlohmann::json& body);
  identity::AccountStore store() { return identity::AccountStore{database_->handle()}; }

  std::optional<config::FolderLock> lock_;
  std::optional<StationClient> station_;  // one of both
  std::unique_ptr<storage::Database> database_;
};

// A password from the terminal, without showing it and twice, or the first line of standard input when that is none.
// Throws when there is none, or both differ.
std::string read_password(const std::string& whose);

// "2026-11-22 07:10" of UTC in microseconds, "" for null.
std::string time_text(const nlohmann::json& at_us);

}  // namespace server::cli
