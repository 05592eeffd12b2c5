// Projected Gauss-Seidel for dense LCPs, served by the protocol of cpbench/solvers/external/served.py.
#include <cmath>
#include <fstream>
#include <iostream>
#include <iterator>
#include <string>
#include <vector>
using Vec = std::vector<double>;

static std::string text(const std::string& line, const std::string& key) {  // of "key": "text"
  size_t at = line.find('"', line.find(':', line.find("\"" + key + "\"")));
  return line.substr(at + 1, line.find('"', at + 1) - at - 1);
}
static double number(const std::string& line, const std::string& key) {
  return std::stod(line.substr(line.find(':', line.find("\"" + key + "\"")) + 1));
}
static Vec read(const std::string& path) {  // .npy: 10 bytes, the last two the length of a header, the header, numbers
  std::ifstream file(path, std::ios::binary);
  std::string all((std::istreambuf_iterator<char>(file)), {});
  size_t at = 10 + (unsigned char)all[8] + 256 * (unsigned char)all[9];
  const double* first = reinterpret_cast<const double*>(all.data() + at);
  return Vec(first, first + (all.size() - at) / sizeof(double));
}
static void write(const std::string& path, const Vec& z) {
  std::string head = "{'descr': '<f8', 'fortran_order': False, 'shape': (" + std::to_string(z.size()) + ",), }";
  head += std::string(117 - head.size(), ' ') + '\n';
  std::ofstream(path, std::ios::binary).write("\x93NUMPY\x01\x00\x76\x00", 10).write(head.data(), 118)
      .write(reinterpret_cast<const char*>(z.data()), z.size() * sizeof(double));
}

int main() {
  Vec M, q, z;
  for (std::string line; std::getline(std::cin, line);) {
    std::string request = text(line, "do"), reply;
    if (request == "quit") return 0;
    if (request == "load") {
      M = read(text(line, "problem") + "/M.npy"), q = read(text(line, "problem") + "/q.npy");
    } else if (request == "solve") {
      size_t n = q.size(), k = 0;
      double change = 1, goal = 0.1 * number(line, "tolerance");
      for (z.assign(n, 0.0); k < 10000 && change > goal; ++k) {
        change = 0;
        for (size_t i = 0; i < n; ++i) {
          double w = q[i];
          for (size_t j = 0; j < n; ++j) w += M[i * n + j] * z[j];
          double next = std::fmax(0.0, z[i] - w / M[i * n + i]);
          change = std::fmax(change, std::fabs(next - z[i])), z[i] = next;
        }
      }
      reply = ", \"claim\": \"" + std::string(change > goal ? "max_iter" : "solved") +
              "\", \"iterations\": " + std::to_string(k);
    } else if (request == "write") {
      write(text(line, "answer") + "/z.npy", z);
    }
    std::cout << "{\"ok\": true" << reply << "}" << std::endl;
  }
}
