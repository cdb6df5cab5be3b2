#include "view/server.h"

#include <array>
#include <chrono>
#include <cstdint>
#include <mutex>
#include <stdexcept>
#include <string_view>
#include <thread>

#include <fmt/format.h>
#include <httplib.h>
#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <nlohmann/json.hpp>

#include "core/printable.h"
#include "view/page.h"

namespace birefit::view {
namespace {

using Json = nlohmann::json;
using Clock = std::chrono::steady_clock;

/// A page that was not heard of for so long is gone: it asks for news all the time.
constexpr std::chrono::seconds kGone{20};
constexpr double kPatience = 5;  ///< s that a question for news is kept open
constexpr std::size_t kLargestRequest = 1 << 20;

constexpr const char* kJson = "application/json";
constexpr const char* kBytes = "application/octet-stream";
// Nothing but what this server has, no script in a line of the page, and the page in no other one's frame.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self' data: blob:; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
// A report has its style in it, its pictures as data, and no script.
constexpr const char* kReportPolicy =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

std::string random_token() {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1)
    throw std::runtime_error("the system gives no random numbers");
  std::string token;
  for (const unsigned char byte : bytes) token += fmt::format("{:02x}", byte);
  return token;
}

bool same(const std::string& a, const std::string& b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

const char* type_of(std::string_view name) {
  return name.ends_with(".html")  ? "text/html; charset=utf-8"
         : name.ends_with(".css") ? "text/css; charset=utf-8"
         : name.ends_with(".js")  ? "text/javascript; charset=utf-8"
         : name.ends_with(".svg") ? "image/svg+xml"
                                  : kBytes;
}

std::string error_text(const std::string& words) {
  return Json({{"error", words}}).dump(-1, ' ', false, Json::error_handler_t::replace);
}

Answers answers_of(const Json& asked) {
  Answers answers;
  answers.kind = asked.at("kind");
  answers.stated.pixel_um = asked.value("pixel_um", 0.0);
  if (const Json& circle = asked.at("circle"); !circle.is_null())
    answers.stated.circle = circle.get<std::array<double, 3>>();
  if (const Json& region = asked.at("region"); !region.is_null()) {
    const auto [x0, y0, x1, y1] = region.get<std::array<int, 4>>();
    answers.stated.region = PixelRect{x0, y0, x1, y1};
  }
  for (const auto& [path, value] : asked.at("numbers").items()) answers.numbers.emplace_back(path, value.get<double>());
  return answers;
}

/// Which page has the session: the first that asked, until it says goodbye or is not heard of any more.
class Guest {
 public:
  bool has(const std::string& client) {
    const std::lock_guard lock(guard_);
    const Clock::time_point now = Clock::now();
    if (client.empty()) return false;
    if (!client_.empty() && client != client_ && now - heard_ < kGone) return false;
    client_ = client;
    heard_ = now;
    return true;
  }
  void leaves(const std::string& client) {
    const std::lock_guard lock(guard_);
    if (client == client_) client_.clear();
  }

 private:
  std::mutex guard_;
  std::string client_;
  Clock::time_point heard_{};
};

}  // namespace

struct Server::State {
  State(Session& of, const Beginning* with) : session(of), beginning(with) {}

  using Answer = std::function<void(const httplib::Request&, httplib::Response&)>;

  /// Who may ask at all: not by another name of this machine, and not another site's page.
  bool refused(const httplib::Request& request, httplib::Response& response) const {
    const std::string host = request.get_header_value("Host"), origin = request.get_header_value("Origin"),
                      site = request.get_header_value("Sec-Fetch-Site");
    std::string words;
    if (host != host_ && host != "localhost:" + std::to_string(port))
      words = "this server has another name: open the address that birefit printed";
    else if (!origin.empty() && origin != "http://" + host)
      words = "a page of another origin may not ask here";
    else if (!site.empty() && site != "same-origin" && site != "none")
      words = "a page of another site may not ask here";
    else if (request.path.size() < token.size() + 2 || !same(request.path.substr(1, token.size()), token) ||
             request.path[token.size() + 1] != '/')
      words = "the address lacks its token: open the whole address that birefit printed";
    if (words.empty()) return false;
    response.status = 403;
    response.set_content(error_text(words), kJson);
    return true;
  }

  /// An answer to the page that has the session; the user's mistakes are answers, too.
  Answer for_guest(Answer answer) {
    return [this, answer = std::move(answer)](const httplib::Request& request, httplib::Response& response) {
      if (!guest.has(request.get_header_value("X-Client"))) {
        response.status = 409;
        response.set_content(error_text("another page has this session: close it first"), kJson);
        return;
      }
      try {
        answer(request, response);
      } catch (const UserError& error) {
        response.status = 400;
        response.set_content(error_text(printable_lines(error.what())), kJson);
      } catch (const Json::exception&) {
        response.status = 400;
        response.set_content(error_text("a request that this server does not understand"), kJson);
      }
    };
  }

  void get(const std::string& path, Answer answer) { http.Get("/" + token + path, std::move(answer)); }
  void post(const std::string& path, const std::function<void(const Json&, httplib::Response&)>& answer) {
    http.Post("/" + token + path, for_guest([answer](const httplib::Request& request, httplib::Response& response) {
                // Forms of other sites cannot send this type without asking first.
                if (!request.get_header_value("Content-Type").starts_with(kJson))
                  throw UserError({}, "a request must be JSON");
                answer(Json::parse(request.body), response);
              }));
  }

  void route();
  void route_page();
  void route_beginning();

  Session& session;
  const Beginning* beginning;
  httplib::Server http;
  std::string token = random_token(), host_, address;
  int port = 0;
  Guest guest;
  std::thread thread;
};

void Server::State::route_page() {
  for (const PageFile& file : page_files())
    get(file.name == "index.html" ? "/" : "/" + std::string(file.name),
        [file](const httplib::Request&, httplib::Response& response) {
          response.set_content(file.content.data(), file.content.size(), type_of(file.name));
        });
  // A page of its own in another tab, which sends no header of ours.
  get("/report.html", [this](const httplib::Request&, httplib::Response& response) {
    try {
      response.set_content(session.report(), "text/html; charset=utf-8");
      response.set_header("Content-Security-Policy", kReportPolicy);
    } catch (const UserError& error) {
      response.status = 404;
      response.set_content(printable_lines(error.what()), "text/plain; charset=utf-8");
    }
  });
  http.Post("/" + token + "/leave", [this](const httplib::Request& request, httplib::Response& response) {
    guest.leaves(request.body);
    response.status = 204;
  });
}

void Server::State::route_beginning() {
  if (!beginning) return;
  get("/beginning", for_guest([this](const httplib::Request&, httplib::Response& response) {
        response.set_content(beginning->description(), kJson);
      }));
  post("/picture",
       [this](const Json&, httplib::Response& response) { response.set_content(beginning->picture(), kBytes); });
  post("/thumbnail", [this](const Json& asked, httplib::Response& response) {
    response.set_content(beginning->thumbnail(asked.at("kind")), kBytes);
  });
  post("/grow", [this](const Json& asked, httplib::Response& response) {
    response.set_content(beginning->grow(answers_of(asked)), kJson);
  });
  post("/open", [this](const Json& asked, httplib::Response& response) {
    session.open(beginning->open(asked.at("text")));
    response.set_content("{}", kJson);
  });
}

void Server::State::route() {
  route_page();
  route_beginning();
  get("/description", for_guest([this](const httplib::Request&, httplib::Response& response) {
        response.set_content(session.description(), kJson);
      }));
  post("/measured", [this](const Json& asked, httplib::Response& response) {
    response.set_content(session.measured(asked.at("item")), kBytes);
  });
  post("/draw", [this](const Json& asked, httplib::Response& response) {
    if (auto drawn = session.draw(asked.at("item"), asked.at("values"), asked.at("settle")))
      response.set_content(std::move(*drawn), kBytes);
    else
      response.status = 204;
  });
  post("/news", [this](const Json& asked, httplib::Response& response) {
    response.set_content(session.news(asked.at("state"), asked.at("line"), kPatience), kJson);
  });
  post("/fit", [this](const Json& asked, httplib::Response& response) {
    session.start_fit(asked.at("values"));
    response.set_content("{}", kJson);
  });
  post("/stop", [this](const Json&, httplib::Response& response) {
    session.stop_fit();
    response.set_content("{}", kJson);
  });
  post("/words", [this](const Json& asked, httplib::Response& response) {
    response.set_content(session.words(asked.at("values")), "text/plain; charset=utf-8");
  });
  post("/config", [this](const Json& asked, httplib::Response& response) {
    response.set_content(session.config_text(asked.at("values")), "text/plain; charset=utf-8");
  });
  post("/save", [this](const Json& asked, httplib::Response& response) {
    const auto path = session.save(asked.at("name"), asked.at("values"), asked.value("overwrite", false));
    response.set_content(Json({{"path", printable(path.string())}}).dump(), kJson);
  });
}

Server::Server(Session& session, int port, const Beginning* beginning)
    : state_(std::make_unique<State>(session, beginning)) {
  State& state = *state_;
  httplib::Server& http = state.http;
  http.set_keep_alive_max_count(1 << 30);
  http.set_keep_alive_timeout(2);  // s, which the end of the program may have to wait for
  http.set_tcp_nodelay(true);
  http.set_payload_max_length(kLargestRequest);
  http.new_task_queue = [] { return new httplib::ThreadPool(16); };  // a connection of a browser holds one
  http.set_default_headers({{"Cache-Control", "no-store"},
                            {"X-Content-Type-Options", "nosniff"},
                            {"Referrer-Policy", "no-referrer"},
                            {"Cross-Origin-Opener-Policy", "same-origin"},
                            {"Cross-Origin-Resource-Policy", "same-origin"},
                            {"X-Frame-Options", "DENY"}});
  http.set_pre_routing_handler([&state](const httplib::Request& request, httplib::Response& response) {
    return state.refused(request, response) ? httplib::Server::HandlerResponse::Handled
                                            : httplib::Server::HandlerResponse::Unhandled;
  });
  http.set_post_routing_handler([](const httplib::Request&, httplib::Response& response) {
    if (!response.has_header("Content-Security-Policy")) response.set_header("Content-Security-Policy", kPolicy);
  });
  http.set_exception_handler([](const httplib::Request&, httplib::Response& response, std::exception_ptr thrown) {
    response.status = 500;
    try {
      std::rethrow_exception(thrown);
    } catch (const std::exception& error) {
      response.set_content(error_text(printable_lines(error.what())), kJson);
    } catch (...) {
      response.set_content(error_text("unknown exception"), kJson);
    }
  });
  // The library's own options let programs share a port, which would get each other's requests.
  http.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  state.route();
  const bool bound = port == 0 ? (state.port = http.bind_to_any_port("127.0.0.1")) > 0
                               : http.bind_to_port("127.0.0.1", state.port = port);
  if (!bound)
    throw UserError({}, fmt::format("127.0.0.1 has no port {} to be had", port), "--port 0 takes one that is free");
  state.host_ = fmt::format("127.0.0.1:{}", state.port);
  state.address = fmt::format("http://{}/{}/", state.host_, state.token);
  state.thread = std::thread([&state] { state.http.listen_after_bind(); });
}

Server::~Server() {
  state_->session.close();
  // stop() waits for nobody who is not yet listening.
  for (int i = 0; i < 200 && !state_->http.is_running(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  state_->http.stop();
  if (state_->thread.joinable()) state_->thread.join();
}

const std::string& Server::address() const { return state_->address; }

}  // namespace birefit::view
