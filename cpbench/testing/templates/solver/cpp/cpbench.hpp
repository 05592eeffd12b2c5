// cpbench.hpp: a solver in C++17 for cpbench. One header, nothing to link; your solver is the only other file.
//
//     cpbench::Answer mine(const cpbench::Problem& problem, const cpbench::Request& request) { ... }
//     int main() { return cpbench::serve("mine", "1.0", mine); }
//
// cpbench starts the program once and sends it lines of JSON: hello, load, warmup, solve, write, quit. Only
// `solve` is timed. Text that your code prints to stdout goes to stderr: stdout belongs to the protocol.
#pragma once
#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <iterator>
#include <limits>
#include <map>
#include <new>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>
#if __has_include(<unistd.h>)
#include <unistd.h>  // dup, dup2
#else
#include <io.h>
#endif

namespace cpbench {
using Vector = std::vector<double>;

/// Exceptions with a status of their own in the row of the run; any other exception is the status `error`.
struct Unsupported : std::runtime_error { using runtime_error::runtime_error; };
struct NoLicence : std::runtime_error { using runtime_error::runtime_error; };

/// A value of JSON. A missing key is a Json of kind `null`.
struct Json {
    enum Kind { null, number, string, list, object } kind = null;  // true and false are the numbers 1 and 0
    double value = 0.0;
    std::string text;
    std::vector<Json> items;
    std::map<std::string, Json> members;
    const Json& operator[](const std::string& key) const {
        static const Json nothing;
        return members.count(key) ? members.at(key) : nothing;
    }
    double or_else(double fallback) const { return kind == number ? value : fallback; }
    std::string or_else(const std::string& fallback) const { return kind == string ? text : fallback; }

    static Json parse(const std::string& source) { const char* at = source.c_str(); return read(at); }
    static std::string quoted(const std::string& raw) {
        std::string out = "\"";
        for (const char c : raw) (c == '"' || c == '\\' ? out += '\\' : out) += c >= 0 && c < ' ' ? ' ' : c;
        return out + '"';
    }
    static void skip(const char*& at) { while (*at && std::strchr(" \t\r\n", *at)) ++at; }
    static void expect(const char*& at, const char* word) {
        skip(at);
        if (std::strncmp(at, word, std::strlen(word)) != 0) throw std::runtime_error(std::string("not JSON: ") + at);
        at += std::strlen(word);
    }
    static Json read(const char*& at) {
        Json j;
        if (skip(at); *at == '{' || *at == '[') {
            const char end = *at++ == '{' ? '}' : ']';
            j.kind = end == '}' ? object : list;
            for (skip(at); *at != end; skip(at)) {
                std::string key;
                if (end == '}') key = read_text(at), expect(at, ":");
                (end == '}' ? j.members[key] : j.items.emplace_back()) = read(at);
                if (skip(at); *at != end) expect(at, ",");
            }
            ++at;
        } else if (*at == '"') j.kind = string, j.text = read_text(at);
        else if (*at == 't') expect(at, "true"), j.kind = number, j.value = 1.0;
        else if (*at == 'f') expect(at, "false"), j.kind = number;
        else if (*at == 'n') expect(at, "null");
        else {
            char* end = nullptr;
            j.kind = number, j.value = std::strtod(at, &end);
            if (end == at) expect(at, "a value");
            at = end;
        }
        return j;
    }
    static std::string read_text(const char*& at) {
        static const char *from = "nrtbf", *to = "\n\r\t\b\f";
        std::string out;
        for (expect(at, "\""); *at && *at != '"'; ++at) {
            if (*at != '\\') { out += *at; continue; }
            const char* known = *++at ? std::strchr(from, *at) : nullptr;
            if (*at != 'u') { out += known ? to[known - from] : *at; continue; }
            unsigned code = hex(at);
            if (code >= 0xD800 && code < 0xDC00 && at[1] == '\\' && at[2] == 'u')  // two halves of one character
                at += 2, code = 0x10000 + ((code - 0xD800) << 10) + (hex(at) - 0xDC00);
            const int more = code < 0x80 ? 0 : code < 0x800 ? 1 : code < 0x10000 ? 2 : 3;  // bytes of UTF-8
            out += static_cast<char>(more ? (0xFF00 >> (more + 1) & 0xFF) | code >> 6 * more : code);
            for (int k = more - 1; k >= 0; --k) out += static_cast<char>(0x80 | (code >> 6 * k & 63));
        }
        expect(at, "\"");
        return out;
    }
    static unsigned hex(const char*& at) {  // moves from the u to the last of its four digits
        unsigned code = 0;
        for (int k = 0; k < 4 && std::isxdigit(static_cast<unsigned char>(at[1])); ++k)
            code = 16 * code + static_cast<unsigned>(*++at <= '9' ? *at - '0' : (*at | 32) - 'a' + 10);
        return code;
    }
};

/// The numbers of a .npy file in C order, and their shape; int64 becomes double, exact up to 2^53.
struct Array { std::vector<std::size_t> shape; Vector data; };

inline std::string read_file(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::runtime_error(path + ": cannot be read");
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline Array read_npy(const std::string& path) {
    const std::string raw = read_file(path);
    if (raw.size() < 12 || raw.compare(0, 6, "\x93NUMPY") != 0) throw std::runtime_error(path + ": no .npy file");
    const auto byte = [&](std::size_t k) { return std::size_t(static_cast<unsigned char>(raw[k])); };
    const std::size_t from = raw[6] == 1 ? 10 : 12;  // version 1 has two bytes of length, versions 2 and 3 four
    const std::size_t begin = from + (byte(8) | byte(9) << 8 | (from == 12 ? byte(10) << 16 | byte(11) << 24 : 0));
    const std::string head = raw.substr(from, begin - from);
    const bool real = head.find("'<f8'") != std::string::npos, whole = head.find("'<i8'") != std::string::npos;
    if (!(real || whole) || head.find("True") != std::string::npos)
        throw std::runtime_error(path + ": expected float64 or int64 in C order, found " + head);
    Array a;
    std::size_t size = 1;
    for (char* at = const_cast<char*>(head.c_str()) + head.find('('); *at && *at != ')';)
        if (std::isdigit(static_cast<unsigned char>(*at))) size *= a.shape.emplace_back(std::strtoull(at, &at, 10));
        else ++at;
    if (raw.size() != begin + 8 * size) throw std::runtime_error(path + ": is cut short");
    a.data.resize(size);
    for (std::size_t k = 0; k < size; ++k) {
        std::int64_t bits;
        std::memcpy(&bits, raw.data() + begin + 8 * k, 8);
        if (whole) a.data[k] = static_cast<double>(bits);
        else std::memcpy(&a.data[k], &bits, 8);
    }
    return a;
}

inline void write_npy(const std::string& path, const Vector& v) {
    std::string head = "{'descr': '<f8', 'fortran_order': False, 'shape': (" + std::to_string(v.size()) + ",), }";
    head.append(63 - (10 + head.size()) % 64, ' ') += '\n';
    std::ofstream file(path, std::ios::binary);
    file << std::string("\x93NUMPY\x01\x00", 8) << char(head.size() & 255) << char(head.size() >> 8) << head;
    file.write(reinterpret_cast<const char*>(v.data()), static_cast<std::streamsize>(8 * v.size()));
    if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

inline std::map<std::string, Array> read_arrays(const std::string& folder) {
    std::map<std::string, Array> found;
    for (const auto& file : std::filesystem::directory_iterator(folder))
        if (file.path().extension() == ".npy") found[file.path().stem().string()] = read_npy(file.path().string());
    return found;
}

/// Compressed rows: those of row i are the entries row[i] ... row[i + 1] - 1 of `column` and `value`.
struct Sparse {
    std::vector<std::size_t> row{0}, column;
    Vector value;
    std::size_t size() const { return row.size() - 1; }
    /// Row i times x.
    double times(std::size_t i, const Vector& x) const {
        double sum = 0;
        for (std::size_t k = row[i]; k < row[i + 1]; ++k) sum += value[k] * x[column[k]];
        return sum;
    }
    Vector operator*(const Vector& x) const {
        Vector y(size());
        for (std::size_t i = 0; i < size(); ++i) y[i] = times(i, x);
        return y;
    }
    /// The transpose times y, for a matrix of n columns.
    Vector transposed(const Vector& y, std::size_t n) const {
        Vector x(n);
        for (std::size_t i = 0; i < size(); ++i)
            for (std::size_t k = row[i]; k < row[i + 1]; ++k) x[column[k]] += value[k] * y[i];
        return x;
    }
    double at(std::size_t i, std::size_t j) const {
        double sum = 0;
        for (std::size_t k = row[i]; k < row[i + 1]; ++k) sum += column[k] == j ? value[k] : 0;
        return sum;
    }
};

inline double norm(const Vector& v) { return std::sqrt(std::inner_product(v.begin(), v.end(), v.begin(), 0.0)); }
inline double max_abs(const Vector& v) {
    double most = 0;
    for (const double x : v) most = std::abs(x) <= most ? most : std::abs(x);  // NaN is the result if there is one
    return most;
}

/// A dense square matrix, row after row, as LU with pivots; throws std::domain_error where it is singular.
struct Lu {
    std::size_t n;
    Vector a;
    std::vector<std::size_t> order;
    Lu(Vector dense, std::size_t size) : n(size), a(std::move(dense)), order(size) {
        const double least = 1e-14 * max_abs(a);
        std::iota(order.begin(), order.end(), std::size_t{0});
        for (std::size_t k = 0; k < n; ++k) {
            std::size_t top = k;
            for (std::size_t i = k; i < n; ++i) top = std::abs(a[i * n + k]) > std::abs(a[top * n + k]) ? i : top;
            if (!(std::abs(a[top * n + k]) > least)) throw std::domain_error("a matrix to solve with is singular");
            for (std::size_t j = 0; top != k && j < n; ++j) std::swap(a[k * n + j], a[top * n + j]);
            std::swap(order[k], order[top]);
            for (std::size_t i = k + 1; i < n; ++i) {
                const double factor = a[i * n + k] /= a[k * n + k];
                for (std::size_t j = k + 1; factor != 0 && j < n; ++j) a[i * n + j] -= factor * a[k * n + j];
            }
        }
    }
    Vector solve(const Vector& b) const {
        Vector x(n);
        for (std::size_t i = 0; i < n; ++i) {
            x[i] = b[order[i]];
            for (std::size_t j = 0; j < i; ++j) x[i] -= a[i * n + j] * x[j];
        }
        for (std::size_t i = n; i-- > 0; x[i] /= a[i * n + i])
            for (std::size_t j = i + 1; j < n; ++j) x[i] -= a[i * n + j] * x[j];
        return x;
    }
};

/// The contents of the folder of a problem: `problem.json`, and the arrays by the names of the formulation.
struct Problem {
    Json fields;  // node, name, and the values that are not arrays: fields["dimension"].value
    std::map<std::string, Array> arrays;
    const Array& array(const std::string& name) const {
        if (!arrays.count(name)) throw std::runtime_error("the problem has no " + name);
        return arrays.at(name);
    }
    const Vector& vector(const std::string& name) const { return array(name).data; }
    /// The rows of a matrix, sparse or dense in its file, without the zeros of a dense one.
    Sparse rows(const std::string& name) const {
        if (arrays.count(name + ".indptr")) {
            const Vector &row = vector(name + ".indptr"), &column = vector(name + ".indices");
            return {{row.begin(), row.end()}, {column.begin(), column.end()}, vector(name + ".data")};
        }
        Sparse m;
        const Array& dense = array(name);
        for (std::size_t i = 0, k = 0; i < dense.shape.at(0); ++i, m.row.push_back(m.value.size()))
            for (std::size_t j = 0; j < dense.shape.at(1); ++j, ++k)
                if (dense.data[k] != 0.0) m.column.push_back(j), m.value.push_back(dense.data[k]);
        return m;
    }
};

/// A nonlinear map as a list of operations on numbered values, as cpbench hands it over: first the
/// unknowns, then the constants, then the result of each operation. `F.jacobian` is a list for the entries by rows.
struct Map {
    Vector constants, heads, left, right, outputs;
    Map(const Problem& p, const std::string& F)
        : constants(p.vector(F + ".constants")), heads(p.vector(F + ".heads")), left(p.vector(F + ".left")),
          right(p.vector(F + ".right")), outputs(p.vector(F + ".outputs")) {}
    Vector operator()(const Vector& z) const {
        Vector value(z), out;
        value.insert(value.end(), constants.begin(), constants.end());
        const auto of = [&](double place) { return place < 0 ? 0.0 : value[static_cast<std::size_t>(place)]; };
        for (std::size_t k = 0; k < heads.size(); ++k)
            value.push_back(apply(static_cast<int>(heads[k]), of(left[k]), of(right[k])));
        for (const double place : outputs) out.push_back(of(place));
        return out;
    }
    static double apply(int head, double a, double b) {  // the numbers are those of cpbench.expressions.operators
        switch (head) {
            case 0: return -a;
            case 1: return std::abs(a);
            case 2: return std::sqrt(a);
            case 3: return std::exp(a);
            case 4: return std::log(a);
            case 5: return std::expm1(a);
            case 6: return std::log1p(a);
            case 7: return std::sin(a);
            case 8: return std::cos(a);
            case 9: return std::tan(a);
            case 10: return std::asin(a);
            case 11: return std::acos(a);
            case 12: return std::atan(a);
            case 13: return std::sinh(a);
            case 14: return std::cosh(a);
            case 15: return std::tanh(a);
            case 16: return std::asinh(a);
            case 17: return std::acosh(a);
            case 18: return std::atanh(a);
            case 19: return std::erf(a);
            case 20: return std::floor(a);
            case 21: return std::ceil(a);
            case 22: return a == 0;
            case 32: return a + b;
            case 33: return a - b;
            case 34: return a * b;
            case 35: return a / b;
            case 36: return std::pow(a, b);
            case 37: return std::atan2(a, b);
            case 38: return std::fmin(a, b);
            case 39: return std::fmax(a, b);
            case 40: return a < b;
            case 41: return a <= b;
            case 42: return a == b;
            case 43: return a != 0 && b != 0;
            case 44: return a != 0 || b != 0;
            case 45: return a != 0 ? b : 0.0;
            default: throw std::runtime_error("a map has the operator " + std::to_string(head) + ", which is none");
        }
    }
};

struct Request {
    double tolerance = 1e-6;
    double seconds = std::numeric_limits<double>::infinity();     // the time limit: after it the program is killed
    double iterations = std::numeric_limits<double>::infinity();  // the largest number allowed
    std::uint64_t seed = 0;
    Json options;                        // options["omega"].or_else(1.0)
    std::map<std::string, Array> start;  // parts of an answer to start from, or empty
};

struct Answer {
    std::string claim = "failed";         // solved, inaccurate, infeasible, unbounded, max_iter or failed
    std::map<std::string, Vector> point;  // the unknowns by the names of the formulation
    long iterations = 0;
    std::string message;
};

/// Serve until cpbench is done. `warmup`, if there is one, is called once and not timed.
inline int serve(const std::string& name, const std::string& version,
                 const std::function<Answer(const Problem&, const Request&)>& solve,
                 const std::function<void()>& warmup = {}) {
    std::FILE* out = fdopen(dup(1), "w");
    dup2(2, 1);
    Problem problem;
    Answer answer;
    const auto reply = [&](const Json& asked) -> std::string {
        const std::string what = asked["do"].text, folder = asked["problem"].text, ok = "\"ok\":true";
        if (what == "hello") return ok + ",\"name\":" + Json::quoted(name) + ",\"version\":" + Json::quoted(version);
        if (what == "load")
            problem = {Json::parse(read_file(folder + "/problem.json")), read_arrays(folder)};
        else if (what == "warmup" && warmup) warmup();
        else if (what == "write") {
            std::filesystem::create_directories(asked["answer"].text);
            for (const auto& [part, value] : answer.point) write_npy(asked["answer"].text + "/" + part + ".npy", value);
        } else if (what == "solve") {
            Request r;
            r.tolerance = asked["tolerance"].or_else(r.tolerance), r.seconds = asked["seconds"].or_else(r.seconds);
            r.iterations = asked["iterations"].or_else(r.iterations), r.options = asked["options"];
            r.seed = static_cast<std::uint64_t>(asked["seed"].or_else(0.0));
            if (asked["start"].kind == Json::string) r.start = read_arrays(asked["start"].text);
            answer = solve(problem, r);
            return ok + ",\"claim\":" + Json::quoted(answer.claim) + ",\"message\":" + Json::quoted(answer.message) +
                   ",\"iterations\":" + std::to_string(answer.iterations);
        }
        return ok;
    };
    for (std::string line, said; std::getline(std::cin, line);) {
        try {
            const Json asked = Json::parse(line);
            if (asked["do"].text == "quit") break;
            said = reply(asked);
        } catch (const Unsupported& e) { said = "\"unsupported\":" + Json::quoted(e.what());
        } catch (const NoLicence& e) { said = "\"state\":\"licence\",\"unavailable\":" + Json::quoted(e.what());
        } catch (const std::bad_alloc& e) { said = "\"memory\":" + Json::quoted(e.what());
        } catch (const std::exception& e) { said = "\"error\":" + Json::quoted(e.what()); }
        std::fprintf(out, "{%s}\n", said.c_str());
        std::fflush(out);
    }
    return 0;
}
}  // namespace cpbench
