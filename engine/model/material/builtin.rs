//! Materials known by name: formula or shares by weight, and nominal density at room temperature.
//!
//! Tissues, glasses, rubber, paraffin and concrete are from the NIST tables of ICRU and ICRP compositions (as in
//! xraylib), breast tissue and the density of inflated lung from ICRU 44, trabecular bone (spongiosa of adults)
//! from ICRU 46, steels and wood from PNNL-15870 Rev. 1. E-glass is that with boron of the ASM Handbook, volume
//! 21. Plastics of several monomers: ABS of equal numbers of its three, PETG with cyclohexanedimethanol for 30 %
//! of the glycol. Collagen is Gly-Pro-Hyp, dry (partial specific volume 0.71 cm3/g). CFRP has 60 % of its volume
//! of fibres in epoxy. Other alloys have the nominal
//! composition, or the middle of the limits, of their standards: EN 573-3 (wrought aluminium), EN 1706
//! (cast aluminium), EN 12163, 12164 and 1982 (copper), EN 1753 (magnesium), EN 1774 (zinc), EN 10088-1
//! (316L), ISO 683-17 (bearing steel), ISO 5832-3 and ASTM F1537 (implants), J-STD-006 (solders), and of the makers' data
//! sheets; elements below 0.1 % are left out. Densities are nominal, to about 1 %.

use std::borrow::Cow;

/// A material known by name.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Builtin {
    /// Its name.
    pub name: Cow<'static, str>,
    /// Chemical formula, or shares by weight as `Cu63wt%Zn37wt%` (a last element without a share
    /// is the rest); empty for vacuum.
    pub formula: Cow<'static, str>,
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
    Builtin { name: Cow::Borrowed(name), formula: Cow::Borrowed(formula), density, aliases }
}

/// Dry air by volume: N2 78.08 %, O2 20.95 %, Ar 0.934 %, CO2 0.041 %.
const AIR: &str = "(N2)0.7808(O2)0.2095Ar0.00934(CO2)0.00041";

const SOFT_TISSUE: &str = "H10.4472wt%C23.219wt%N2.488wt%Na0.113wt%Mg0.013wt%P0.133wt%S0.199wt%Cl0.134wt%K0.199wt%\
     Ca0.023wt%Fe0.005wt%Zn0.003wt%O";
const SOFT_TISSUE_ICRU: &str = "H10.1172wt%C11.1wt%N2.6wt%O";
const ADIPOSE: &str = "H11.9477wt%N0.797wt%O23.2333wt%Na0.05wt%Mg0.002wt%P0.016wt%S0.073wt%Cl0.119wt%K0.032wt%\
     Ca0.002wt%Fe0.002wt%Zn0.002wt%C";
const MUSCLE: &str = "H10.0637wt%C10.783wt%N2.768wt%Na0.075wt%Mg0.019wt%P0.18wt%S0.241wt%Cl0.079wt%K0.302wt%\
     Ca0.003wt%Fe0.004wt%Zn0.005wt%O";
const LUNG: &str = "H10.1278wt%C10.231wt%N2.865wt%Na0.184wt%Mg0.073wt%P0.08wt%S0.225wt%Cl0.266wt%K0.194wt%\
     Ca0.009wt%Fe0.037wt%Zn0.001wt%O";
const BLOOD: &str = "H10.1866wt%C10.002wt%N2.964wt%Na0.185wt%Mg0.004wt%Si0.003wt%P0.035wt%S0.185wt%Cl0.278wt%\
     K0.163wt%Ca0.006wt%Fe0.046wt%Zn0.001wt%O";
const BRAIN: &str = "H11.0667wt%C12.542wt%N1.328wt%Na0.184wt%Mg0.015wt%P0.354wt%S0.177wt%Cl0.236wt%K0.31wt%\
     Ca0.009wt%Fe0.005wt%Zn0.001wt%O";
const SKIN: &str = "H10.0588wt%C22.825wt%N4.642wt%Na0.007wt%Mg0.006wt%P0.033wt%S0.159wt%Cl0.267wt%K0.085wt%\
     Ca0.015wt%Fe0.001wt%Zn0.001wt%O";
const CORTICAL_BONE: &str =
    "H4.7234wt%C14.433wt%N4.199wt%Mg0.22wt%P10.497wt%S0.315wt%Ca20.993wt%Zn0.01wt%O";
const COMPACT_BONE: &str = "H6.3984wt%C27.8wt%N2.7wt%Mg0.2wt%P7wt%S0.2wt%Ca14.7wt%O";
const TRABECULAR_BONE: &str = "H8.5wt%C40.4wt%N2.8wt%Na0.1wt%Mg0.1wt%P3.4wt%S0.2wt%Cl0.2wt%K0.1wt%Ca7.4wt%\
     Fe0.1wt%O";
const E_GLASS: &str = "B2.4843wt%Na0.4452wt%Mg2.8349wt%Al8.0428wt%Si25.3834wt%Ca12.2927wt%O";
const PYREX: &str = "B4.0064wt%Na2.8191wt%Al1.1644wt%Si37.722wt%K0.3321wt%O";
const LEAD_GLASS: &str = "O15.6453wt%Si8.0866wt%Ti0.8092wt%As0.2651wt%Pb";
const PLATE_GLASS: &str = "Na9.6441wt%Si33.6553wt%Ca10.7205wt%O";
const CONCRETE: &str =
    "H1wt%C0.1wt%Na1.6wt%Mg0.2wt%Al3.3872wt%Si33.7021wt%K1.3wt%Ca4.4wt%Fe1.4wt%O";
const BREAST: &str = "H10.6wt%C33.2wt%N3wt%Na0.1wt%P0.1wt%S0.2wt%Cl0.1wt%O";
const STEEL: &str = "C0.5wt%Fe";
const STEEL_304: &str = "C0.04wt%Si0.5wt%P0.023wt%S0.015wt%Cr19wt%Mn1wt%Ni9.25wt%Fe";
const STEEL_316: &str = "C0.041wt%Si0.507wt%P0.023wt%S0.015wt%Cr17wt%Mn1.014wt%Ni12wt%Mo2.5wt%Fe";
const STEEL_316L: &str = "C0.02wt%Si0.5wt%Cr17.5wt%Mn1wt%Ni11.5wt%Mo2.25wt%Fe";
const WOOD: &str = "H5.9642wt%N0.497wt%O42.7435wt%Mg0.1988wt%S0.497wt%K0.1988wt%Ca0.1988wt%C";

const AL_7075: &str = "Zn5.6wt%Mg2.5wt%Cu1.6wt%Cr0.23wt%Al";
const NI_718: &str = "Ni52.5wt%Cr19wt%Nb5.1wt%Mo3.05wt%Ti0.9wt%Al0.5wt%Fe";

static BUILTINS: &[Builtin] = &[
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
    m("polystyrene foam", "C8H8", 0.03, &["expanded polystyrene", "EPS", "styrofoam"]),
    m("ABS", "C15H17N", 1.05, &["acrylonitrile butadiene styrene"]),
    m("PETG", "C11.8H11O4", 1.27, &["PET-G"]),
    m("rubber", "C5H8", 0.92, &["natural rubber"]),
    m("paraffin", "C25H52", 0.93, &["paraffin wax"]),
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
    m("CFRP", "H2.1908wt%O5.7842wt%C", 1.56, &["carbon fibre reinforced plastic", "CRP"]),
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
    m("hydroxyapatite", "Ca5P3O13H", 3.16, &["HA", "HAp"]),
    m("collagen", "C12H17N3O4", 1.41, &["dry collagen"]),
    m("tungsten carbide", "WC", 15.63, &[]),
    m("cemented carbide", "Co10wt%W84.4832wt%C", 14.5, &["WC10Co", "hardmetal"]),
    m("cadmium telluride", "CdTe", 5.85, &[]),
    m("gallium arsenide", "GaAs", 5.318, &[]),
    m("caesium iodide", "CsI", 4.51, &["cesium iodide"]),
    m("gadox", "Gd2O2S", 7.32, &["gadolinium oxysulfide", "gadolinium oxysulphide"]),
    m("soft tissue", SOFT_TISSUE, 1.0, &["soft tissue ICRP"]),
    m("soft tissue ICRU", SOFT_TISSUE_ICRU, 1.0, &[]),
    m("adipose tissue", ADIPOSE, 0.92, &["fat", "adipose"]),
    m("breast tissue", BREAST, 1.02, &["breast"]),
    m("muscle", MUSCLE, 1.04, &["skeletal muscle"]),
    m("lung, deflated", LUNG, 1.05, &["lung tissue", "deflated lung"]),
    m("lung, inflated", LUNG, 0.26, &["inflated lung"]),
    m("blood", BLOOD, 1.06, &[]),
    m("brain", BRAIN, 1.03, &["brain tissue"]),
    m("skin", SKIN, 1.1, &[]),
    m("cortical bone", CORTICAL_BONE, 1.85, &["bone"]),
    m("trabecular bone", TRABECULAR_BONE, 1.18, &["spongiosa", "cancellous bone"]),
    m("compact bone", COMPACT_BONE, 1.85, &[]),
    m("borosilicate glass", PYREX, 2.23, &["pyrex", "pyrex glass"]),
    m("soda-lime glass", PLATE_GLASS, 2.4, &["plate glass", "window glass", "float glass"]),
    m("glass fibre", E_GLASS, 2.58, &["glass fiber", "E-glass", "glass fibre E"]),
    m("lead glass", LEAD_GLASS, 6.22, &[]),
    m("concrete", CONCRETE, 2.3, &["portland concrete"]),
    m("wood", WOOD, 0.64, &["pine"]),
    m("carbon steel", STEEL, 7.82, &["mild steel"]),
    m(
        "stainless steel 304",
        STEEL_304,
        8.0,
        &["SS304", "SUS304", "AISI 304", "steel 304", "stainless steel", "X5CrNi18-10"],
    ),
    m(
        "stainless steel 316",
        STEEL_316,
        8.0,
        &["SS316", "SUS316", "AISI 316", "steel 316", "X5CrNiMo17-12-2"],
    ),
    m(
        "stainless steel 316L",
        STEEL_316L,
        8.0,
        &["SS316L", "316L", "steel 316L", "X2CrNiMo17-12-2", "1.4404"],
    ),
    m("bearing steel", "C1wt%Cr1.5wt%Mn0.35wt%Si0.25wt%Fe", 7.83, &["100Cr6"]),
    m("invar", "Ni36wt%Fe", 8.1, &["FeNi36"]),
    m("kovar", "Ni29wt%Co17wt%Fe", 8.36, &["FeNi29Co17"]),
    m(
        "aluminium 2024",
        "Cu4.35wt%Mg1.5wt%Mn0.6wt%Al",
        2.78,
        &["Al2024", "AA2024", "AlCu4Mg1", "EN AW-2024"],
    ),
    m(
        "aluminium 5083",
        "Mg4.45wt%Mn0.7wt%Cr0.15wt%Al",
        2.66,
        &["Al5083", "AA5083", "AlMg4.5Mn0.7", "EN AW-5083"],
    ),
    m("aluminium 5754", "Mg3.1wt%Mn0.25wt%Al", 2.67, &["Al5754", "AA5754", "AlMg3", "EN AW-5754"]),
    m(
        "aluminium 6061",
        "Mg1wt%Si0.6wt%Cu0.28wt%Cr0.2wt%Al",
        2.7,
        &["Al6061", "AA6061", "AlMg1SiCu", "EN AW-6061"],
    ),
    m(
        "aluminium 6082",
        "Si1wt%Mg0.9wt%Mn0.7wt%Al",
        2.7,
        &["Al6082", "AA6082", "AlSi1MgMn", "AlMgSi1", "EN AW-6082"],
    ),
    m(
        "aluminium 7075",
        AL_7075,
        2.81,
        &["Al7075", "AA7075", "AlZn5.5MgCu", "AlZn6MgCu", "EN AW-7075"],
    ),
    m("AlSi7Mg", "Si7wt%Mg0.35wt%Al", 2.68, &["AlSi7Mg0.3", "A356"]),
    m("AlSi10Mg", "Si10wt%Mg0.325wt%Al", 2.67, &["EN AC-43000"]),
    m("AlSi12", "Si12wt%Al", 2.65, &["EN AC-44200"]),
    m("magnesium AZ31", "Al3wt%Zn1wt%Mn0.3wt%Mg", 1.77, &["AZ31", "MgAl3Zn1"]),
    m("magnesium AZ91", "Al9wt%Zn0.7wt%Mn0.2wt%Mg", 1.81, &["AZ91", "MgAl9Zn1"]),
    m("brass", "Cu63wt%Zn37wt%", 8.44, &["CuZn37"]),
    m("brass CuZn30", "Cu70wt%Zn30wt%", 8.53, &["CuZn30", "cartridge brass"]),
    m("brass CuZn39Pb3", "Cu58wt%Pb3wt%Zn", 8.47, &["CuZn39Pb3", "free-cutting brass"]),
    m("bronze", "Cu94wt%Sn6wt%", 8.8, &["CuSn6"]),
    m("bronze CuSn8", "Sn8wt%Cu", 8.8, &["CuSn8"]),
    m("bronze CuSn12", "Sn12wt%Cu", 8.7, &["CuSn12"]),
    m("beryllium copper", "Be1.9wt%Cu", 8.25, &["CuBe", "CuBe2"]),
    m("constantan", "Ni44wt%Mn1wt%Cu", 8.9, &["CuNi44", "CuNi44Mn1"]),
    m("nickel silver", "Cu62wt%Ni18wt%Zn", 8.7, &["CuNi18Zn20"]),
    m("zamak 3", "Al4wt%Zn", 6.6, &["ZnAl4", "zamak"]),
    m("zamak 5", "Al4wt%Cu1wt%Zn", 6.7, &["ZnAl4Cu1"]),
    m("cobalt chrome", "Cr28wt%Mo6wt%Co", 8.3, &["CoCr", "CoCr28Mo6", "CoCrMo"]),
    m(
        "nickel alloy 625",
        "Cr21.5wt%Mo9wt%Nb3.65wt%Fe2.5wt%Ni",
        8.44,
        &["NiCr22Mo9Nb", "In625", "inconel 625"],
    ),
    m("nickel alloy 718", NI_718, 8.19, &["NiCr19Fe19Nb5Mo3", "In718", "inconel 718"]),
    m("solder Sn63Pb37", "Sn63wt%Pb37wt%", 8.4, &["Sn63Pb37", "SnPb37"]),
    m("solder SAC305", "Ag3wt%Cu0.5wt%Sn", 7.38, &["SnAg3Cu0.5", "Sn96.5Ag3Cu0.5"]),
    m("titanium alloy", "Al6wt%V4wt%Ti", 4.43, &["Ti-6Al-4V", "Ti64", "TiAl6V4"]),
    m("titanium alloy Ti-6Al-7Nb", "Al6wt%Nb7wt%Ti", 4.52, &["Ti-6Al-7Nb", "TiAl6Nb7"]),
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

/// The built-in materials of a formula, as it is spelled in their list.
pub(super) fn of_formula(formula: &str) -> Vec<&'static Builtin> {
    BUILTINS.iter().filter(|entry| !formula.is_empty() && entry.formula == formula).collect()
}

/// All built-in materials.
pub fn builtins() -> &'static [Builtin] {
    BUILTINS
}

/// Names of all built-in materials, without their aliases.
pub fn builtin_names() -> impl Iterator<Item = &'static str> {
    BUILTINS.iter().map(|entry| &*entry.name)
}

/// Spellings of built-in materials, with their name: the name itself first, then its aliases.
pub(super) fn all_spellings<'a>() -> impl Iterator<Item = (&'a str, &'a str)> {
    BUILTINS.iter().flat_map(|entry| {
        let spellings = std::iter::once(&*entry.name).chain(entry.aliases.iter().copied());
        spellings.map(|spelling| (&*entry.name, spelling))
    })
}
