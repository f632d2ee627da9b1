// One subcommand an act.
#include "server/cli/accounts/user.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "server/cli/accounts/account_door.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

using Act = UserCommand::Act;

CLI::App* offer(CLI::App& command, UserCommand& wish, Act act, const char* name, const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", wish.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->callback([&wish, act] { wish.act = act; });
  return sub;
}

void add_name(CLI::App* command, UserCommand& wish) {
  command->add_option("name", wish.name, "The user: 1 to 31 characters of [a-z0-9._-]")->required()->check(named());
}

int list(AccountDoor& door, const UserCommand& wish, std::ostream& out) {
  const nlohmann::json users = door.users();
  if (wish.json) {
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

void add_options(CLI::App& command, UserCommand& wish) {
  command.require_subcommand(1);
  auto* add = offer(command, wish, Act::add, "add", "Add a user; the password is asked for");
  add_name(add, wish);
  add_word(*add, "--role", wish.role, kRoles, "viewer (sees, stops), operator (commands) or admin")->required();
  add->footer("Example: rheonaut user add anna --role operator --data lab");
  offer(command, wish, Act::list, "list", "List the users")->add_flag("--json", wish.json, "As JSON");
  add_name(offer(command, wish, Act::remove, "remove", "Remove a user, with sessions and tokens"), wish);
  add_name(offer(command, wish, Act::password, "password", "Give a user a new password; ends their sessions"), wish);
  auto* role = offer(command, wish, Act::role, "role", "Give a user another role");
  add_name(role, wish);
  add_word(*role, "role", wish.role, kRoles, "viewer, operator or admin")->required();
  add_name(offer(command, wish, Act::disable, "disable", "Keep a user out until enabled again"), wish);
  add_name(offer(command, wish, Act::enable, "enable", "Let a disabled user in again"), wish);
  command.footer("Example: rheonaut user list --data lab");
}

int run(const UserCommand& wish, std::ostream& out) {
  const bool wants_password = wish.act == Act::add || wish.act == Act::password;
  if (wish.act == Act::add) {
    if (const auto named = check_name(wish.name); !named) throw std::runtime_error{named.error().detail};
  }
  const std::string password = wants_password ? read_password(wish.name) : "";
  AccountDoor door{wish.data_dir, wish.act == Act::add ? AccountDoor::Missing::make : AccountDoor::Missing::refuse};
  const char* done = "";
  switch (wish.act) {
    case Act::list: return list(door, wish, out);
    case Act::add: door.add_user(wish.name, wish.role, password), done = "was added"; break;
    case Act::remove: door.remove_user(wish.name), done = "was removed"; break;
    case Act::password: door.set_password(wish.name, password), done = "has a new password"; break;
    case Act::role: door.set_role(wish.name, wish.role), done = "has a new role"; break;
    case Act::disable: door.set_disabled(wish.name, true), done = "is kept out"; break;
    case Act::enable: door.set_disabled(wish.name, false), done = "may sign in"; break;
  }
  fmt::print(out, "User {} {}\n", wish.name, done);
  return 0;
}

}  // namespace server::cli
