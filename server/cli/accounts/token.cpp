// One subcommand an act.
#include "server/cli/accounts/token.hpp"

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>

#include "server/cli/accounts/account_access.hpp"
#include "server/cli/terminal/options.hpp"

namespace server::cli {
namespace {

CLI::App* offer(CLI::App& command, TokenCommand& options, TokenCommand::Act act, const char* name,
                const char* purpose) {
  CLI::App* sub = command.add_subcommand(name, purpose);
  sub->add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  sub->add_flag("--json", options.json, "As JSON");
  sub->callback([&options, act] { options.act = act; });
  return sub;
}

int list_tokens(const nlohmann::json& tokens, bool as_json, std::ostream& out) {
  if (as_json) {
    fmt::print(out, "{}\n", tokens.dump(2));
    return 0;
  }
  if (tokens.empty()) fmt::print(out, "There are no API tokens\n");
  for (const auto& token : tokens) {
    const std::string used = time_text(token.at("last_used_at_us"));
    const std::string expires = time_text(token.at("expires_at_us"));
    const std::string expired = time_text(token.at("expired_at_us"));
    const std::string revoked = time_text(token.at("revoked_at_us"));
    fmt::print(out, "{:<31}  {}  made {}, used {}{}{}{}\n", token.at("name").get<std::string>(),
               token.at("scopes").get<std::string>(), time_text(token.at("made_at_us")), used.empty() ? "never" : used,
               expires.empty() ? "" : ", until " + expires,
               expired.empty() || !revoked.empty() ? "" : ", refused since " + expired,
               revoked.empty() ? "" : ", revoked " + revoked);
  }
  return 0;
}

int create(const TokenCommand& options, std::ostream& out) {
  const auto scopes = identity::parse_scopes(options.scopes);
  if (!scopes) throw std::runtime_error{scopes.error().detail};
  const nlohmann::json made =
      AccountAccess{options.data_dir, AccountAccess::Missing::make}.add_token(options.name, *scopes, options.days);
  if (options.json) {
    fmt::print(out, "{}\n", made.dump(2));
  } else {
    fmt::print(out, "{}\n", made.at("secret").get<std::string>());
  }
  return 0;
}

}  // namespace

void add_options(CLI::App& command, TokenCommand& options) {
  command.require_subcommand(1);
  auto* create =
      offer(command, options, TokenCommand::Act::create, "create", "Make a token and print it: it is shown only now");
  create->add_option("name", options.name, "What it is called: 1 to 31 characters of [a-z0-9._-]")
      ->required()
      ->check(named());
  create->add_option("--scopes", options.scopes, "Of read, stop, record, command, admin (default: read,stop)")
      ->check(named());
  create->add_option("--days", options.days, "After so many it runs out (default: it does not)")->check(whole(1, 3650));
  create->footer("Example: rheonaut token create logger --scopes read,record --days 30 --data lab");
  offer(command, options, TokenCommand::Act::list, "list", "List the tokens");
  offer(command, options, TokenCommand::Act::revoke, "revoke", "End a token at once")
      ->add_option("name", options.name, "What it is called")
      ->required()
      ->check(named());
  offer(command, options, TokenCommand::Act::revive, "revive",
        "Let a token hold again that expired while this computer's clock was ahead")
      ->add_option("name", options.name, "What it is called")
      ->required()
      ->check(named());
  command.footer("Example: rheonaut token list --data lab");
}

int run(const TokenCommand& options, std::ostream& out) {
  if (options.act == TokenCommand::Act::create) return create(options, out);
  AccountAccess accounts{options.data_dir, AccountAccess::Missing::refuse};
  if (options.act == TokenCommand::Act::list) return list_tokens(accounts.tokens(), options.json, out);
  const bool is_revived = options.act == TokenCommand::Act::revive;
  is_revived ? accounts.revive_token(options.name) : accounts.revoke_token(options.name);
  const char* const result = is_revived ? "holds again" : "was revoked";
  if (options.json) {
    fmt::print(out, "{}\n", nlohmann::json{{"name", options.name}, {"result", result}}.dump(2));
  } else {
    fmt::print(out, "Token {} {}\n", options.name, result);
  }
  return 0;
}

}  // namespace server::cli
