// One subcommand an act.
#include "server/cli/accounts/user.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

CLI::App* offer(CLI::App& command, UserCommand& options, UserCommand::Act act, const char* name, const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

void add_name(CLI::App* command, UserCommand& options) {
  command->add_option("name", options.name, "The user: 1 to 31 characters of [a-z0-9._-]")->required()->check(named());
}

int list(AccountAccess& accounts, const UserCommand& options, std::ostream& out) {
  const nlohmann::json users = accounts.users();
  if (options.json) {
    fmt::print(out, "{}\n", users.dump(2));
    return 0;
  }
  if (users.empty()) fmt::print(out, "There are no users; people get in by one-time links, as admin\n");
  for (const auto& user : users) {
    fmt::print(out, "{:<31}  {:<8}  made {} by {}{}\n", user.at("name").get<std::string>(),
               user.at("role").get<std::string>(), time_text(user.at("made_at_us")),
               user.at("made_by").get<std::string>(), user.at("disabled").get<bool>() ? ", disabled" : "");
  }
  return 0;
}

}  // namespace

void add_options(CLI::App& command, UserCommand& options) {
  command.require_subcommand(1);
  auto* add = offer(command, options, UserCommand::Act::add, "add", "Add a user; the password is asked for");
  add_name(add, options);
  add_word(*add, "--role", options.role, identity::kRoles, "viewer (sees, stops), operator (commands) or admin")
      ->required();
  add->footer("Example: rheonaut user add anna --role operator --data lab");
  offer(command, options, UserCommand::Act::list, "list", "List the users");
  add_name(offer(command, options, UserCommand::Act::remove, "remove", "Remove a user, with sessions and tokens"),
           options);
  add_name(offer(command, options, UserCommand::Act::password, "password",
                 "Give a user a new password; ends their sessions"),
           options);
  auto* role = offer(command, options, UserCommand::Act::role, "role", "Give a user another role");
  add_name(role, options);
  add_word(*role, "role", options.role, identity::kRoles, "viewer, operator or admin")->required();
  add_name(offer(command, options, UserCommand::Act::disable, "disable", "Keep a user out until enabled again"),
           options);
  add_name(offer(command, options, UserCommand::Act::enable, "enable", "Let a disabled user in again"), options);
  command.footer("Example: rheonaut user list --data lab");
}

int run(const UserCommand& options, std::ostream& out) {
  const bool wants_password = options.act == UserCommand::Act::add || options.act == UserCommand::Act::password;
  if (options.act == UserCommand::Act::add) {
    if (const auto named = identity::check_name(options.name); !named) throw std::runtime_error{named.error().detail};
  }
  const std::string password = wants_password ? read_password(options.name) : "";
  AccountAccess accounts{options.data_dir, options.act == UserCommand::Act::add ? AccountAccess::Missing::make
                                                                                : AccountAccess::Missing::refuse};
  const char* done = "";
  switch (options.act) {
    case UserCommand::Act::list: return list(accounts, options, out);
    case UserCommand::Act::add: accounts.add_user(options.name, options.role, password), done = "was added"; break;
    case UserCommand::Act::remove: accounts.remove_user(options.name), done = "was removed"; break;
    case UserCommand::Act::password: accounts.set_password(options.name, password), done = "has a new password"; break;
    case UserCommand::Act::role: accounts.set_role(options.name, options.role), done = "has a new role"; break;
    case UserCommand::Act::disable: accounts.set_disabled(options.name, true), done = "is kept out"; break;
    case UserCommand::Act::enable: accounts.set_disabled(options.name, false), done = "may sign in"; break;
  }
  if (options.json) {
    fmt::print(out, "{}\n", nlohmann::json{{"name", options.name}, {"result", done}}.dump(2));
  } else {
    fmt::print(out, "User {} {}\n", options.name, done);
  }
  return 0;
}

}  // namespace server::cli
