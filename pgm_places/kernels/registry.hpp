// How a file of kernels puts its functions into the extension module.
//
//     PGM_KERNELS(module) {
//         module.add("fill_slots", fill_slots, "edges"_a, "next_slot"_a, ...);
//     }
//
// Files are found by CMake and register themselves, so that no list names them. Kernels run without
// the interpreter lock.

#pragma once

#include <nanobind/nanobind.h>

#include <map>
#include <stdexcept>
#include <string>

#include "pgm_places/kernels/array.hpp"

namespace pgm {

namespace nb = nanobind;

// The module, as one file of kernels sees it.
class Module {
  public:
    Module(nb::module_ &module, const char *file, std::map<std::string, std::string> &files)
        : module_(module), file_(file), files_(files) {}

    // Add a kernel; the same name again, in one file, is the kernel for other types of arguments.
    template <class Function, class... Names>
    void add(const char *name, Function function, const Names &...names) {
        auto [entry, is_new] = files_.emplace(name, file_);
        if (!is_new && entry->second != file_)
            throw std::logic_error(std::string(name) + " is in " + entry->second + " and in " +
                                   file_);
        module_.def(name, function, names..., nb::call_guard<nb::gil_scoped_release>());
    }

  private:
    nb::module_ &module_;
    const char *file_;
    std::map<std::string, std::string> &files_;
};

// A file of kernels that waits for the module to be made.
class Registration {
  public:
    using Function = void (*)(Module &);

    Registration(Function function, const char *file)
        : function_(function), file_(file), next_(first()) {
        first() = this;
    }

    static Registration *&first() {
        static Registration *entry = nullptr;
        return entry;
    }

  private:
    friend void register_all(nb::module_ &);
    Function function_;
    const char *file_;
    Registration *next_;
};

inline void register_all(nb::module_ &module) {
    std::map<std::string, std::string> files;
    for (Registration *one = Registration::first(); one != nullptr; one = one->next_) {
        Module part(module, one->file_, files);
        one->function_(part);
    }
}

}  // namespace pgm

using namespace nanobind::literals;  // "edges"_a, in files of kernels

#define PGM_KERNELS(module)                                                     \
    static void register_kernels(pgm::Module &);                                \
    static const pgm::Registration registration(register_kernels, __FILE__);    \
    static void register_kernels(pgm::Module &module)
