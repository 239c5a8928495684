//! Materials known by name: formula and nominal density at room temperature.

/// A material known by name.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Builtin {
    /// Its name.
    pub name: &'static str,
    /// Chemical formula; empty for vacuum.
    pub formula: &'static str,
    /// Density, g/cm3.
    pub density: f64,
    /// Other names for it.
    pub aliases: &'static [&'static str],
}

const fn m(
    name: &'static str,
    formula: &'static str,
    density: f64,
    aliases: &'static [&'static str],
) -> Builtin {
    Builtin { name, formula, density, aliases }
}

/// Dry air by volume: N2 78.08 %, O2 20.95 %, Ar 0.934 %, CO2 0.041 %.
const AIR: &str = "(N2)0.7808(O2)0.2095Ar0.00934(CO2)0.00041";

const BUILTINS: &[Builtin] = &[
    m("vacuum", "", 0.0, &[]),
    m("air", AIR, 0.001_205, &[]),
    m("helium", "He", 0.000_166, &[]),
    m("argon", "Ar", 0.001_66, &[]),
    m("water", "H2O", 1.0, &[]),
    m("ethanol", "C2H5OH", 0.789, &[]),
    m("glycerol", "C3H8O3", 1.261, &["glycerin", "glycerine"]),
    m("polyethylene", "C2H4", 0.93, &["polythene", "PE"]),
    m("polypropylene", "C3H6", 0.9, &["PP"]),
    m("polystyrene", "C8H8", 1.05, &["PS"]),
    m("polycarbonate", "C16H14O3", 1.2, &["PC"]),
    m("PMMA", "C5H8O2", 1.18, &["acrylic", "plexiglass", "perspex"]),
    m("nylon 66", "C12H22N2O2", 1.14, &["polyamide 66", "PA 66"]),
    m("nylon 6", "C6H11NO", 1.13, &["polyamide 6", "PA 6"]),
    m("nylon 12", "C12H23NO", 1.01, &["polyamide 12", "PA 12"]),
    m("PET", "C10H8O4", 1.38, &["mylar", "polyethylene terephthalate"]),
    m("PLA", "C3H4O2", 1.24, &["polylactide", "polylactic acid"]),
    m("PEEK", "C19H12O3", 1.32, &[]),
    m("PTFE", "C2F4", 2.2, &["teflon"]),
    m("PVC", "C2H3Cl", 1.38, &["polyvinyl chloride"]),
    m("POM", "CH2O", 1.41, &["acetal", "polyoxymethylene", "delrin"]),
    m("PDMS", "C2H6OSi", 0.965, &["silicone"]),
    m("kapton", "C22H10N2O5", 1.42, &["polyimide"]),
    m("SU-8", "C87H118O16", 1.2, &[]),
    m("epoxy", "C21H24O4", 1.2, &["epoxy resin"]),
    m("carbon", "C", 2.0, &["amorphous carbon"]),
    m("carbon fibre", "C", 1.8, &["carbon fiber"]),
    m("graphite", "C", 2.26, &[]),
    m("diamond", "C", 3.52, &[]),
    m("silicon", "Si", 2.329, &[]),
    m("silica", "SiO2", 2.2, &["fused silica", "silicon dioxide"]),
    m("quartz", "SiO2", 2.65, &[]),
    m("silicon nitride", "Si3N4", 3.17, &[]),
    m("silicon carbide", "SiC", 3.21, &[]),
    m("sapphire", "Al2O3", 3.98, &["alumina", "aluminium oxide", "aluminum oxide"]),
    m("zirconia", "ZrO2", 5.68, &["zirconium dioxide"]),
    m("calcium carbonate", "CaCO3", 2.71, &["calcite"]),
    m("hydroxyapatite", "Ca5P3O13H", 3.16, &[]),
    m("cadmium telluride", "CdTe", 5.85, &[]),
    m("gallium arsenide", "GaAs", 5.318, &[]),
    m("caesium iodide", "CsI", 4.51, &["cesium iodide"]),
    m("gadox", "Gd2O2S", 7.32, &["gadolinium oxysulfide", "gadolinium oxysulphide"]),
    m("lithium", "Li", 0.534, &[]),
    m("beryllium", "Be", 1.848, &[]),
    m("magnesium", "Mg", 1.738, &[]),
    m("aluminium", "Al", 2.699, &["aluminum"]),
    m("sulfur", "S", 2.07, &["sulphur"]),
    m("titanium", "Ti", 4.506, &[]),
    m("chromium", "Cr", 7.19, &["chrome"]),
    m("iron", "Fe", 7.874, &[]),
    m("cobalt", "Co", 8.9, &[]),
    m("nickel", "Ni", 8.908, &[]),
    m("copper", "Cu", 8.96, &[]),
    m("zinc", "Zn", 7.14, &[]),
    m("germanium", "Ge", 5.323, &[]),
    m("zirconium", "Zr", 6.52, &[]),
    m("molybdenum", "Mo", 10.28, &[]),
    m("rhodium", "Rh", 12.41, &[]),
    m("palladium", "Pd", 12.02, &[]),
    m("silver", "Ag", 10.49, &[]),
    m("indium", "In", 7.31, &[]),
    m("tin", "Sn", 7.265, &[]),
    m("tantalum", "Ta", 16.69, &[]),
    m("tungsten", "W", 19.25, &["wolfram"]),
    m("iridium", "Ir", 22.56, &[]),
    m("platinum", "Pt", 21.45, &[]),
    m("gold", "Au", 19.3, &[]),
    m("lead", "Pb", 11.34, &[]),
    m("bismuth", "Bi", 9.78, &[]),
    m("uranium", "U", 19.1, &[]),
];

/// A name without case, blanks, hyphens and underscores, so that "Nylon-66" is "nylon 66".
pub(super) fn fold(name: &str) -> String {
    name.chars().filter(|c| !matches!(c, ' ' | '-' | '_')).flat_map(char::to_lowercase).collect()
}

/// The built-in material of this name or alias (case, blanks and hyphens do not matter), or the
/// element of this symbol. Carbon has several densities: it goes by its names only.
pub fn builtin(name: &str) -> Option<&'static Builtin> {
    let wanted = fold(name);
    let named = BUILTINS.iter().find(|entry| {
        std::iter::once(&entry.name).chain(entry.aliases).any(|known| fold(known) == wanted)
    });
    // Symbols keep their case: "Co" is cobalt, "CO" would be a compound.
    named.or_else(|| {
        let symbol = name.len() <= 2 && name != "C" && !name.is_empty();
        let single = symbol && !name.chars().skip(1).any(|c| c.is_uppercase() || c.is_numeric());
        BUILTINS.iter().find(|entry| single && entry.formula == name)
    })
}

/// All built-in materials.
pub const fn builtins() -> &'static [Builtin] {
    BUILTINS
}

/// Names of all built-in materials, without their aliases.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTINS.iter().map(|entry| entry.name)
}

pub(super) fn all_spellings<'a>() -> impl Iterator<Item = &'a str> {
    BUILTINS
        .iter()
        .flat_map(|entry| std::iter::once(entry.name).chain(entry.aliases.iter().copied()))
}
