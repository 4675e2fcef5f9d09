#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the software bill of materials of a bundle: SPDX 2.3 as JSON.

Versions, source packages and licences of the libraries come from dpkg of this machine.
"""
import argparse
import datetime
import hashlib
import json
import pathlib
import re
import subprocess


def dpkg_fields(package):
    """Returns version, architecture, source package and its version, maintainer and home page of a package."""
    form = "${Version}\t${Architecture}\t${source:Package}\t${source:Version}\t${Maintainer}\t${Homepage}\n"
    text = subprocess.run(["dpkg-query", "-W", "-f", form, package], check=True, capture_output=True, text=True).stdout
    return text.splitlines()[0].split("\t")


def licences(package):
    """Returns the short names of licences in a machine-readable copyright file, as one comment."""
    path = pathlib.Path(f"/usr/share/doc/{package}/copyright")
    names = re.findall(r"^License:[ \t]*(\S.*)$", path.read_text(errors="replace"), re.MULTILINE)
    unique = sorted({name.strip() for name in names})
    return "Debian's copyright file names: " + "; ".join(unique) if unique else "See the copyright file in licenses/."


def sha256(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def spdx_id(text):
    return "SPDXRef-" + re.sub(r"[^A-Za-z0-9.-]", "-", text)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--name", required=True, help="name of the bundle")
    parser.add_argument("--version", required=True)
    parser.add_argument("--epoch", required=True, type=int, help="time of the document, s since 1970")
    parser.add_argument("--folder", required=True, type=pathlib.Path, help="the unpacked bundle")
    parser.add_argument("--libraries", required=True, type=pathlib.Path, help="lines PACKAGE FILE of what was taken")
    parser.add_argument("--out", required=True, type=pathlib.Path)
    options = parser.parse_args()

    own = {
        "SPDXID": "SPDXRef-emitd",
        "name": "emitd",
        "versionInfo": options.version,
        "downloadLocation": "NOASSERTION",
        "filesAnalyzed": False,
        "licenseConcluded": "Apache-2.0",
        "licenseDeclared": "Apache-2.0",
        "copyrightText": "NOASSERTION",
        "primaryPackagePurpose": "APPLICATION",
    }
    packages = [own]
    files = []
    relations = [{"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES",
                  "relatedSpdxElement": own["SPDXID"]}]

    def add_file(path, owner):
        name = path.relative_to(options.folder).as_posix()
        files.append({
            "SPDXID": spdx_id("file-" + name),
            "fileName": "./" + name,
            "checksums": [{"algorithm": "SHA256", "checksumValue": sha256(path)}],
            "licenseConcluded": "NOASSERTION",
            "copyrightText": "NOASSERTION",
        })
        relations.append({"spdxElementId": owner, "relationshipType": "CONTAINS",
                          "relatedSpdxElement": files[-1]["SPDXID"]})

    for program in sorted((options.folder / "bin").iterdir()):
        add_file(program, own["SPDXID"])
    taken = sorted(line.split() for line in options.libraries.read_text().splitlines())
    for package in sorted({package for package, _ in taken}):
        version, architecture, source, source_version, maintainer, home = dpkg_fields(package)
        identity = spdx_id("deb-" + package)
        packages.append({
            "SPDXID": identity,
            "name": package,
            "versionInfo": version,
            "supplier": "Organization: Debian",
            "originator": "Person: " + maintainer,
            "homepage": home or "NOASSERTION",
            "downloadLocation": "NOASSERTION",
            "filesAnalyzed": False,
            "sourceInfo": f"Debian source package {source} {source_version}",
            "licenseConcluded": "NOASSERTION",
            "licenseDeclared": "NOASSERTION",
            "licenseComments": licences(package),
            "copyrightText": "NOASSERTION",
            "primaryPackagePurpose": "LIBRARY",
            "externalRefs": [{
                "referenceCategory": "PACKAGE-MANAGER",
                "referenceType": "purl",
                "referenceLocator": f"pkg:deb/debian/{package}@{version.replace('+', '%2B').replace(':', '%3A')}"
                                    f"?arch={architecture}&distro=debian-12",
            }],
        })
        relations.append({"spdxElementId": own["SPDXID"], "relationshipType": "DEPENDS_ON",
                          "relatedSpdxElement": identity})
        for owner, file in taken:
            if owner == package:
                add_file(options.folder / file, identity)

    content = hashlib.sha256(json.dumps([packages, files], sort_keys=True).encode()).hexdigest()
    document = {
        "spdxVersion": "SPDX-2.3",
        "dataLicense": "CC0-1.0",
        "SPDXID": "SPDXRef-DOCUMENT",
        "name": options.name,
        "documentNamespace": f"urn:sha256:{content}",
        "creationInfo": {
            "created": datetime.datetime.fromtimestamp(options.epoch, datetime.timezone.utc)
                       .strftime("%Y-%m-%dT%H:%M:%SZ"),
            "creators": ["Tool: sbom.py of emitd " + options.version],
        },
        "packages": packages,
        "files": files,
        "relationships": relations,
    }
    options.out.write_text(json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    main()
