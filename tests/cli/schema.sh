#!/usr/bin/env bash
# `birefit schema`: JSON that every shipped config and template satisfies and mistakes of editors' users do not.
# usage: schema.sh BIREFIT SOURCE_DIR
set -u
birefit=$(realpath "$1")
source=$(realpath "$2")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work" || exit 1
"$birefit" schema > schema.json 2> stderr.txt || { echo "FAIL schema: $(cat stderr.txt)"; exit 1; }
python3 -c 'import yaml' 2> /dev/null || { echo 'no python3-yaml here: not validated'; exit 0; }
for kind in $("$birefit" new | awk '/^  [a-z]/ { print $1 }'); do "$birefit" new "$kind" > "new_$kind.yaml"; done
cp "$source"/fit_configs/*.yaml .
python3 - << 'PYTHON'
import glob, json, re, sys, yaml

schema = json.load(open('schema.json'))
known = {'$schema', 'title', 'description', 'default', 'type', 'properties', 'additionalProperties', 'items', 'anyOf',
         'enum', 'const', 'minimum', 'maximum', 'exclusiveMinimum', 'exclusiveMaximum', 'minItems', 'maxItems',
         'minProperties', 'maxProperties', 'pattern'}
types = {'object': dict, 'array': list, 'string': str, 'number': (int, float), 'integer': int, 'boolean': bool}


def mistakes(value, s, place=''):
    """Places at which a value does not satisfy the part of JSON Schema that is used."""
    assert not set(s) - known, set(s) - known
    found = []
    if 'type' in s:
        wanted = s['type'] if isinstance(s['type'], list) else [s['type']]
        if not any(isinstance(value, types[t]) for t in wanted) or (isinstance(value, bool) and 'boolean' not in wanted):
            return [place]
    if 'const' in s and value != s['const'] or 'enum' in s and value not in s['enum']:
        found.append(place)
    if isinstance(value, str) and not re.search(s.get('pattern', ''), value):
        found.append(place)
    if isinstance(value, (int, float)):
        if value < s.get('minimum', value) or value > s.get('maximum', value):
            found.append(place)
        if 'exclusiveMinimum' in s and value <= s['exclusiveMinimum']:
            found.append(place)
        if 'exclusiveMaximum' in s and value >= s['exclusiveMaximum']:
            found.append(place)
    if isinstance(value, (list, dict)):
        kind = 'Items' if isinstance(value, list) else 'Properties'
        if not s.get('min' + kind, 0) <= len(value) <= s.get('max' + kind, len(value)):
            found.append(place)
    if isinstance(value, list) and 'items' in s:
        for i, item in enumerate(value):
            found += mistakes(item, s['items'], f'{place}[{i}]')
    if isinstance(value, dict):
        for key, item in value.items():
            if key in s.get('properties', {}):
                found += mistakes(item, s['properties'][key], f'{place}.{key}')
            elif s.get('additionalProperties') is False:
                found.append(f'{place}.{key}')
    if 'anyOf' in s and all(mistakes(value, one, place) for one in s['anyOf']):
        found.append(place)
    return found


class Loader(yaml.SafeLoader):
    """Numbers as YAML 1.2 has them: 1e-4 is one."""


Loader.add_implicit_resolver('tag:yaml.org,2002:float',
                             re.compile(r'^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$'), list('-+0123456789.'))
failures = 0
files = sorted(glob.glob('*.yaml'))
assert len(files) > 30, files
for name in files:
    found = mistakes(yaml.load(open(name), Loader), schema)
    if found:
        failures += 1
        print('FAIL', name, 'at', found)
good = yaml.load(open('e12_droplet.yaml'), Loader)
for place, value in [(('sampel',), 1), (('micrograph', 'pixelsize'), 1), (('sample', 'droplet', 'diameter_um'), -3),
                     (('microscope', 'light', 'wavelength_nm'), '590 nm'),
                     (('sample', 'droplet', 'diameter_um'), {'value': 9, 'fitt': [8, 10]}),
                     (('sample', 'droplet', 'director'), {'radial': {}, 'axial': {}}),
                     (('sample', 'droplet', 'diameter_um'), '9.3'), (('report',), ['a'])]:
    bad = json.loads(json.dumps(good))
    block = bad
    for key in place[:-1]:
        block = block[key]
    block[place[-1]] = value
    if not mistakes(bad, schema):
        failures += 1
        print('FAIL', place, value, 'passes')
described = schema['properties']['sample']['properties']['cell']['properties']['thickness_um']
assert described['description'] == 'between the faces (um)' and described['anyOf'][0]['exclusiveMinimum'] == 0, described
sys.exit(failures > 0)
PYTHON
[ $? -eq 0 ] || exit 1
echo 'all as required'
