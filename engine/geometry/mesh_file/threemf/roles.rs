//! Roles of the objects and triangles of a 3MF file, by its types and by the settings of slicers. Only
//! parts of the model are read.

use std::collections::HashMap;
use std::str::FromStr;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// Files of slicers that give roles to the triangles of an object (`PrusaSlicer`), or to its components
/// (Bambu Studio, `OrcaSlicer`).
pub(super) const SETTINGS: [&str; 2] =
    ["metadata/slic3r_pe_model.config", "metadata/model_settings.config"];

/// Role of what is no part of the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Support,
    Surface,
    Other,
    Modifier,
    Negative,
}

impl Role {
    /// The role of an object by its attribute `type`; `None` for the model itself.
    pub(super) fn of_type(text: &str) -> Result<Option<Self>, String> {
        Ok(match text {
            "model" => None,
            "support" | "solidsupport" => Some(Self::Support),
            "surface" => Some(Self::Surface),
            "other" => Some(Self::Other),
            _ => {
                let text = beamlet_core::printed::line(text);
                let allowed = "model, support, solidsupport, surface, other";
                return Err(format!("type is \"{text}\"; allowed: {allowed}"));
            }
        })
    }

    /// The role of an object by a setting of Cura that is true.
    pub(super) fn of_setting(name: &str) -> Option<Self> {
        match name.strip_prefix("cura:")? {
            "support_mesh" | "anti_overhang_mesh" => Some(Self::Support),
            "infill_mesh" | "cutting_mesh" => Some(Self::Modifier),
            _ => None,
        }
    }

    /// The role of a volume or part of a slicer.
    fn of_volume(text: &str) -> Option<Self> {
        match text {
            "NegativeVolume" | "negative_part" => Some(Self::Negative),
            "ParameterModifier" | "modifier_part" => Some(Self::Modifier),
            "SupportBlocker" | "SupportEnforcer" | "support_blocker" | "support_enforcer" => {
                Some(Self::Support)
            }
            _ => None,
        }
    }

    /// The reason why it is left out.
    pub(super) const fn reason(self) -> &'static str {
        match self {
            Self::Support => "support",
            Self::Surface => "a surface, which encloses nothing",
            Self::Other => "type other",
            Self::Modifier => "modifies settings of a slicer",
            Self::Negative => "a negative volume of a slicer: its hole is not cut",
        }
    }
}

/// Roles by the settings of a slicer, for objects of the first model.
#[derive(Debug, Default)]
pub(super) struct Roles {
    /// Triangles of an object, the first and the last.
    triangles: HashMap<u32, Vec<([u32; 2], Role)>>,
    /// Components, by the object that they belong to and their own.
    components: HashMap<[u32; 2], Role>,
}

impl Roles {
    /// Adds the roles in a file of a slicer. What is not valid in it has none.
    pub(super) fn read(&mut self, text: &str) {
        let mut reader = Reader::from_str(text);
        let (mut object, mut volume) = (None, None);
        loop {
            match reader.read_event() {
                Ok(Event::Start(tag) | Event::Empty(tag)) => match tag.local_name().into_inner() {
                    "object" => object = number(&tag, "id"),
                    "volume" => {
                        volume = number(&tag, "firstid").zip(number(&tag, "lastid"));
                    }
                    "part" => {
                        let role = value(&tag, "subtype").and_then(|text| Role::of_volume(&text));
                        if let (Some(object), Some(part), Some(role)) =
                            (object, number(&tag, "id"), role)
                        {
                            self.components.insert([object, part], role);
                        }
                    }
                    "metadata" => {
                        if let (Some(object), Some((first, last)), Some(role)) =
                            (object, volume, setting(&tag))
                        {
                            let all = self.triangles.entry(object).or_default();
                            all.push(([first, last], role));
                        }
                    }
                    _ => {}
                },
                Ok(Event::End(tag)) if tag.local_name().into_inner() == "volume" => volume = None,
                Ok(Event::Eof) | Err(_) => return,
                Ok(_) => {}
            }
        }
    }

    /// The role of a component of an object.
    pub(super) fn of_component(&self, object: u32, component: u32) -> Option<Role> {
        self.components.get(&[object, component]).copied()
    }

    /// Triangles of an object that have roles, the first and the last.
    pub(super) fn of_triangles(&self, object: u32) -> &[([u32; 2], Role)] {
        self.triangles.get(&object).map_or(&[], Vec::as_slice)
    }

    /// Marks of the triangles of an object that have roles, of `count`; empty where none has.
    pub(super) fn marked(&self, object: u32, count: usize) -> Vec<bool> {
        let ranges = self.of_triangles(object);
        if ranges.is_empty() {
            return Vec::new();
        }
        // Ranges that begin less those that ended, so that many ranges cost no more than one.
        let mut changes = vec![0_i64; count + 1];
        for ([first, last], _) in ranges.iter().filter(|(ends, _)| ends[0] <= ends[1]) {
            changes[(*first as usize).min(count)] += 1;
            changes[(*last as usize).saturating_add(1).min(count)] -= 1;
        }
        let mut open = 0;
        let counted = changes.iter().take(count).map(|change| {
            open += change;
            open > 0
        });
        counted.collect()
    }
}

/// The role by a setting of a volume: its type, or in old files that it modifies.
fn setting(tag: &BytesStart<'_>) -> Option<Role> {
    let text = value(tag, "value")?;
    match value(tag, "key")?.as_str() {
        "volume_type" => Role::of_volume(&text),
        "modifier" if text == "1" => Some(Role::Modifier),
        _ => None,
    }
}

fn value(tag: &BytesStart<'_>, key: &str) -> Option<String> {
    let attribute = tag.try_get_attribute(key).ok()??;
    Some(attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0).ok()?.into_owned())
}

fn number<T: FromStr>(tag: &BytesStart<'_>, key: &str) -> Option<T> {
    value(tag, key)?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_triangles_are_marked_with_both_ends() {
        let mut roles = Roles::default();
        let volume = |ends: [u32; 2], kind: &str| {
            let [first, last] = ends;
            let metadata = format!("<metadata key=\"volume_type\" value=\"{kind}\"/>");
            format!("<volume firstid=\"{first}\" lastid=\"{last}\">{metadata}</volume>")
        };
        let volumes = [
            volume([0, 0], "ModelPart"),
            volume([1, 2], "ParameterModifier"),
            volume([2, 3], "NegativeVolume"),
            volume([9, 4_000_000_000], "SupportBlocker"),
            volume([7, 6], "SupportBlocker"),
        ];
        roles.read(&format!("<config><object id=\"3\">{}</object></config>", volumes.concat()));
        let marked = [false, true, true, true, false, false, false, false, false, true];
        assert_eq!(roles.marked(3, 10), marked);
        assert!(roles.marked(4, 10).is_empty());
        roles.read("<config><object id=\"3\"><volume firstid=\"0\"");
    }
}
