// LoadedLibrary: a shared library that is loaded when it is needed, not at every start of the program.
#pragma once

#include <dlfcn.h>
#include <fmt/format.h>

#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace imud {

class LoadedLibrary {
 public:
  // Loads the first library of these names that exists; the library stays loaded. If there is none, throws
  // std::runtime_error with the reason and the Debian package that contains the library.
  LoadedLibrary(std::initializer_list<const char*> names, std::string_view package) {
    for (const char* const name : names)
      if (library_ == nullptr) library_ = ::dlopen(name, RTLD_LAZY | RTLD_LOCAL);
    if (library_ == nullptr) throw std::runtime_error(fmt::format("{}; it is in {}", ::dlerror(), package));
  }
  // Sets `function` to the library's function of that name. Throws std::runtime_error if there is none.
  template <class Function>
  void find(const char* name, Function& function) const {
    function = reinterpret_cast<Function>(::dlsym(library_, name));
    if (function == nullptr) throw std::runtime_error(::dlerror());
  }

 private:
  void* library_ = nullptr;
};

}  // namespace imud
