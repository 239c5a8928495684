//! Energies and spectra at the ends of their ranges.

use super::{is_balanced, is_refused, workplace};
use crate::support::program::Workplace;
use crate::support::sample;
use std::fs;

#[test]
fn energies_reach_from_a_tenth_of_a_kilovolt_to_eight_hundred() {
    let place = workplace();
    for energy in sample(vec!["0.1 keV", "1 keV", "799.999999 keV", "800 keV"], 3) {
        is_balanced(&place, &[&format!("source.energy={energy}")]);
    }
    for energy in ["0.0999999 keV", "800.000001 keV", "1e-300 keV", "1e300 keV"] {
        let set = format!("source.energy={energy}");
        is_refused(&place, &[&set], &["source.energy", "0.1 keV to 800 keV"]);
    }
}

fn file(place: &Workplace, text: &str) -> String {
    fs::write(place.path("a.csv"), text).unwrap();
    "source={distance=\"1.21 m\",spot=\"0 m\",spectrum=\"a.csv\"}".into()
}

#[test]
fn spectra_may_fill_the_tables_and_weigh_next_to_nothing() {
    let place = workplace();
    let texts = [
        "0.1,1\n",
        "800,1\n",
        "0.1,1\n0.2,2\n400,3\n800,1\n",
        "799.9999999,1\n800,1e-300\n",
        "20,1e-299\n30,2e-299\n",
        "20,1e307\n30,1e307\n",
    ];
    for text in sample(texts.to_vec(), 2) {
        is_balanced(&place, &[&file(&place, text)]);
    }
}

#[test]
fn tubes_run_at_the_voltages_of_their_tables() {
    let place = workplace();
    let tube = |anode: &str, kvp: &str| {
        let spectrum = format!("{{anode=\"{anode}\",kvp=\"{kvp}\",nodes=3}}");
        format!("source={{distance=\"1.21 m\",spot=\"0 m\",spectrum={spectrum}}}")
    };
    for (anode, low, high) in [("tungsten", 20, 160), ("molybdenum", 20, 50)] {
        for kvp in [low, high] {
            is_balanced(&place, &[&tube(anode, &format!("{kvp} kV"))]);
        }
    }
}
