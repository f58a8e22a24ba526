"""A small scenario in the forms of version 1.0, written by hand, with a catalog of vehicles."""

from collections.abc import Mapping
from pathlib import Path

SCENARIO = """<?xml version="1.0" encoding="UTF-8"?>
<OpenSCENARIO xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="OpenSCENARIO.xsd">
  <FileHeader revMajor="1" revMinor="0" date="2020-10-30T10:00:00" description="cut-in" author="test"/>
  <ParameterDeclarations>
    <ParameterDeclaration name="$speed" parameterType="double" value="13.5"/>
    <ParameterDeclaration name="runs" parameterType="integer" value="2"/>
    <ParameterDeclaration name="owner" parameterType="string" value="ego"/>
  </ParameterDeclarations>
  <CatalogLocations><VehicleCatalog><Directory path="catalogs"/></VehicleCatalog></CatalogLocations>
  <RoadNetwork><LogicFile filepath="Town01"/><SceneGraphFile filepath="town.osgb"/></RoadNetwork>
  <Entities>
    <ScenarioObject name="ego">
      <CatalogReference catalogName="Cars" entryName="sedan">
        <ParameterAssignments><ParameterAssignment parameterRef="top" value="$speed"/></ParameterAssignments>
      </CatalogReference>
    </ScenarioObject>
    <ScenarioObject name="other"><CatalogReference catalogName="Cars" entryName="sedan"/></ScenarioObject>
    <EntitySelection name="both"><Members><ByType objectType="vehicle"/></Members></EntitySelection>
  </Entities>
  <Storyboard>
    <Init><Actions>
      <Private entityRef="$owner">
        <PrivateAction>
          <ControllerAction>
            <AssignControllerAction><Controller name="c"><Properties/></Controller></AssignControllerAction>
            <OverrideControllerValueAction><Brake value="0" active="false"/></OverrideControllerValueAction>
          </ControllerAction>
        </PrivateAction>
      </Private>
      <Private entityRef="both">
        <PrivateAction><TeleportAction><Position>
          <LanePosition roadId="1" laneId="-1" s="50"/>
        </Position></TeleportAction></PrivateAction>
      </Private>
    </Actions></Init>
    <Story name="story">
      <Act name="act">
        <ManeuverGroup maximumExecutionCount="$runs" name="group">
          <Actors selectTriggeringEntities="false"><EntityRef entityRef="both"/></Actors>
          <Maneuver name="maneuver">
            <Event name="event" priority="overwrite">
              <Action name="action"><PrivateAction><LateralAction>
                <LaneChangeAction>
                  <LaneChangeActionDynamics dynamicsShape="cubic" value="3" dynamicsDimension="time"/>
                  <LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget>
                </LaneChangeAction>
              </LateralAction></PrivateAction></Action>
              <StartTrigger><ConditionGroup>
                <Condition name="near" delay="0.5" conditionEdge="rising">
                  <ByEntityCondition>
                    <TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="both"/></TriggeringEntities>
                    <EntityCondition>
                      <TimeHeadwayCondition entityRef="other" value="2" freespace="0" rule="lessThan"
                        alongRoute="true"/>
                    </EntityCondition>
                  </ByEntityCondition>
                </Condition>
                <Condition name="far" delay="0" conditionEdge="none">
                  <ByEntityCondition>
                    <TriggeringEntities triggeringEntitiesRule="all"><EntityRef entityRef="ego"/></TriggeringEntities>
                    <EntityCondition>
                      <RelativeDistanceCondition entityRef="other" value="9" freespace="1" rule="lessThan"
                        relativeDistanceType="cartesianDistance"/>
                    </EntityCondition>
                  </ByEntityCondition>
                </Condition>
              </ConditionGroup></StartTrigger>
            </Event>
          </Maneuver>
        </ManeuverGroup>
        <StartTrigger><ConditionGroup>
          <Condition name="time" delay="0" conditionEdge="none">
            <ByValueCondition><SimulationTimeCondition value="${1 + $runs}" rule="greaterThan"/></ByValueCondition>
          </Condition>
        </ConditionGroup></StartTrigger>
      </Act>
    </Story>
    <StopTrigger/>
  </Storyboard>
</OpenSCENARIO>
"""

CATALOG = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="0" date="2020-10-30T10:00:00" description="" author=""/>
  <Catalog name="Cars">
    <Vehicle name="sedan" vehicleCategory="car">
      <ParameterDeclarations>
        <ParameterDeclaration name="top" parameterType="double" value="60"/>
      </ParameterDeclarations>
      <BoundingBox><Center x="1.4" y="0" z="0.7"/><Dimensions width="1.8" length="4.5" height="1.5"/></BoundingBox>
      <Performance maxSpeed="$top" maxAcceleration="5" maxDeceleration="9"/>
      <Axles>
        <FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.6" positionX="2.8" positionZ="0.3"/>
        <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.6" positionX="0" positionZ="0.3"/>
      </Axles>
      <Properties><Property name="color" value="red"/></Properties>
    </Vehicle>
  </Catalog>
</OpenSCENARIO>
"""


def write_hand_written_scenario(folder: Path, edits: Mapping[str, str] | None = None, catalog: str = CATALOG) -> Path:
    """Write the scenario, with texts in it replaced, and its catalog into a folder; returns the scenario's path."""
    text = SCENARIO
    for old, new in (edits or {}).items():
        assert old in text
        text = text.replace(old, new)
    (folder / "catalogs").mkdir(exist_ok=True)
    (folder / "catalogs/cars.xosc").write_text(catalog)
    (folder / "scenario.xosc").write_text(text)
    return folder / "scenario.xosc"


def line_with(text: str) -> int:
    """The 1-based line of the scenario with a text."""
    return next(number for number, line in enumerate(SCENARIO.splitlines(), 1) if text in line)
