// The methods of methods.def, by number and by name.

#include <stdexcept>

#include "transport/methods.h"

namespace birefit {

template <class S>
std::span<const TransportMethod<S>* const> transport_methods() {
#define BIREFIT_METHOD(Method) static const Method<S> instance_##Method;
#include "transport/methods.def"
#undef BIREFIT_METHOD
  static const TransportMethod<S>* const list[] = {
#define BIREFIT_METHOD(Method) &instance_##Method,
#include "transport/methods.def"
#undef BIREFIT_METHOD
  };
  return list;
}

template <class S>
const TransportMethod<S>& transport_method(const std::string& name) {
  for (const TransportMethod<S>* method : transport_methods<S>())
    if (name == method->info().name) return *method;
  throw std::logic_error("no transport method named " + name);
}

const std::vector<std::string>& transport_method_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto* method : transport_methods<double>()) list.emplace_back(method->info().name);
    return list;
  }();
  return names;
}

#define BIREFIT_INSTANTIATE(S)                                                \
  template std::span<const TransportMethod<S>* const> transport_methods<S>(); \
  template const TransportMethod<S>& transport_method<S>(const std::string&);
BIREFIT_FOR_EACH_SCALAR_OF_TABLES(BIREFIT_INSTANTIATE)

}  // namespace birefit
