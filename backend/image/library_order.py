#!/usr/bin/env python3
"""Writes the libraries that a shared library needs and that have many symbols to bind, those first
that others need: the order in which image.cpp opens them. Prints their paths, a CMake list.

    library_order.py LIBRARY OUTPUT.inc
"""
import os
import re
import subprocess
import sys

# Symbols to bind from which a library is worth a place.
MANY = 1500
RELOCATION = 24  # bytes of an Elf64_Rela


def output_of(*command):
    # Their texts are translated.
    environment = {**os.environ, "LC_ALL": "C"}
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True,
                          env=environment).stdout


def dynamic_sections(paths):
    """By path: the libraries needed, and how many relocations name a symbol."""
    sections = {}
    text = output_of("readelf", "-dW", *paths)
    if len(paths) == 1:
        text = "File: " + paths[0] + "\n" + text
    for part in re.split(r"^File: ", text, flags=re.M)[1:]:
        def number(tag):
            found = re.search(r"\(%s\)\s+(\d+)" % tag, part)
            return int(found[1]) if found else 0

        relocations = (number("RELASZ") + number("PLTRELSZ")) // RELOCATION - number("RELACOUNT")
        sections[part.split("\n", 1)[0]] = (re.findall(r"\(NEEDED\).*\[(.*)\]", part), relocations)
    return sections


def main():
    library, output = sys.argv[1:]
    paths = dict(re.findall(r"^\s*(\S+) => (/.+) \(0x", output_of("ldd", library), re.M))
    sections = dynamic_sections([library, *paths.values()])
    order = []

    def visit(name, path):
        if name in visited:
            return
        visited.add(name)
        needed, relocations = sections[path]
        for other in needed:
            if other in paths:
                visit(other, paths[other])
        if relocations >= MANY and path != library:
            order.append(name)

    visited = set()
    visit(library.rsplit("/", 1)[-1], library)
    text = "".join('"%s",\n' % name for name in order)
    # Only a new order makes anything build again.
    if not os.path.exists(output) or open(output).read() != text:
        with open(output, "w") as file:
            file.write(text)
    print(";".join(paths[name] for name in order), end="")


main()
